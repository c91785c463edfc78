"""What many experiments have shown together."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass, field, replace

from tests.promises.findings import Finding, merged
from tests.promises.promises import CHECKERS
from tests.simulation.outcome import Outcome


@dataclass
class Summary:
    hours: float = 0.0
    experiments: int = 0
    messages: int = 0
    restarts: int = 0
    injected: Counter[str] = field(default_factory=Counter)
    alone: Counter[str] = field(default_factory=Counter)
    findings: dict[str, list[Finding]] = field(default_factory=lambda: {promise: [] for promise in CHECKERS})
    digests: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, outcome: Outcome) -> Summary:
        history = outcome.history
        return cls(
            outcome.experiment.length / 3600.0,
            1,
            outcome.messages,
            len(history.lives) - len({life.program for life in history.lives}),
            outcome.injected,
            outcome.alone,
            {finding.promise: [_named(finding, outcome.experiment.seed)] for finding in outcome.findings},
            [outcome.digest],
        )

    def add(self, other: Summary) -> None:
        self.hours += other.hours
        self.experiments += other.experiments
        self.messages += other.messages
        self.restarts += other.restarts
        self.injected += other.injected
        self.alone += other.alone
        self.digests += other.digests
        for promise, findings in other.findings.items():
            self.findings[promise] += findings

    def total(self) -> list[Finding]:
        return [merged(findings) for findings in self.findings.values() if findings]

    def violated(self) -> list[str]:
        return [each.promise for each in self.total() if each.evidence]

    @property
    def digest(self) -> str:
        return hashlib.sha256("".join(self.digests).encode()).hexdigest()[:16]


def _named(finding: Finding, seed: str) -> Finding:
    evidence = [each._replace(text=f"{each.text} ({seed})") for each in finding.evidence]
    return replace(finding, evidence=evidence)
