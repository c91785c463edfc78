"""Faults that are drawn from the seed, and the search for the smallest part of them that matters."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any, TypeVar

T = TypeVar("T")
KINDS = ("kill", "stop", "loss", "delay", "cut")
LOSS = 0.3
"""The part of the packets that is lost during a fault of the kind ``loss``."""
_SHORTEST, _LONGEST = 0.1, 5.0  # s of a fault
_MINUTE = 60.0  # s


@dataclass(frozen=True)
class Fault:
    """Something that happens to a simulation."""

    at: float
    """Since the beginning [s]."""
    kind: str
    """``kill`` and ``stop`` a program, lose packets (``loss``), ``delay`` a topic, ``cut`` two hosts."""
    target: str
    """The name of a program, a topic, or two hosts with a space; empty for ``loss``."""
    length: float
    """How long it lasts [s]; a killed program is started again then."""

    def __str__(self) -> str:
        return f"{' '.join(filter(None, (self.kind, self.target)))} for {self.length} s"


def _kind_and_target(what: str) -> tuple[str, str]:
    """Split what a fault is called. Raises ValueError if it cannot hit anything."""
    kind, _, target = what.partition(" ")
    if kind not in KINDS:
        raise ValueError(f"no fault is called {kind!r}; they are {', '.join(KINDS)}")
    if kind == "delay" and target and not target.startswith("/"):
        raise ValueError(f"{what!r}: the full name of a topic begins with /")
    if kind == "cut" and len(target.split()) == 1:
        raise ValueError(f"{what!r}: a cut is between two hosts")
    return kind, " ".join(sorted(target.split())) if kind == "cut" else target


class Faults:
    """The faults of a simulation."""

    def __init__(self, simulation: Any) -> None:
        """:param simulation: a :class:`Simulation`, which this module cannot import."""
        self.inflicted: list[Fault] = []
        """Those that have begun."""
        self.programs: set[str] = set()
        """The names of all programs that were started."""
        self._drawn_for: set[str] = set()  # programs
        self._simulation = simulation
        self._losses = 0

    def inflict(self, faults: Iterable[Fault]) -> None:
        """Let faults happen at their times. One whose target does not live then is left out."""
        for fault in faults:
            _kind_and_target(f"{fault.kind} {fault.target}".strip())
            self._simulation.at(fault.at, lambda it=fault: self._begin(it))  # type: ignore[misc]

    def draw(self, rates: Mapping[str, float]) -> None:
        """Let faults happen by chance, for as long as the simulation runs.

        :param rates: how many in a minute, by kind, or by kind and target: ``kill`` or ``kill talker``.
        """
        for what, rate in rates.items():
            kind, target = _kind_and_target(what)
            if target and kind in ("kill", "stop"):
                self._drawn_for.add(target)
            if rate > 0.0:
                self._draw_next(kind, target, rate, Random(f"{self._simulation.seed} {what}"))

    def check(self) -> None:
        """Raise ValueError if faults were drawn for a program that was never started: a wrong name."""
        unknown = self._drawn_for - self.programs
        if unknown and self.programs:
            raise ValueError(
                f"no program was called {' or '.join(sorted(unknown))}, which faults were to hit;"
                f" they were called {', '.join(sorted(self.programs))}"
            )

    def _draw_next(self, kind: str, target: str, rate: float, random: Random) -> None:
        at = round(self._simulation.now + random.expovariate(rate / _MINUTE), 3)
        length, choice = round(random.uniform(_SHORTEST, _LONGEST), 3), random.random()

        def begin() -> None:
            if targets := [each for each in self._targets(kind) if not target or each == target]:
                self._begin(Fault(at, kind, targets[int(choice * len(targets))], length))
            self._draw_next(kind, target, rate, random)

        self._simulation.at(at, begin)

    def _targets(self, kind: str) -> list[str]:
        simulation = self._simulation
        if kind in ("kill", "stop"):
            return [process.name for process in simulation.processes if not process.is_suspended]
        if kind == "cut":
            hosts = sorted({process.host.name for process in simulation.processes})
            return [" ".join(pair) for pair in itertools.combinations(hosts, 2)]
        return simulation.topics() if kind == "delay" else [""]

    def _process(self, name: str) -> Any:
        return next((each for each in self._simulation.processes if each.name == name), None)

    def _begin(self, fault: Fault) -> None:
        simulation, after = self._simulation, self._simulation.after
        process = self._process(fault.target)
        if fault.kind in ("kill", "stop"):
            if process is None:
                return
            if fault.kind == "kill":
                process.kill()
                after(fault.length, process.start_again)
            else:
                process.stop()
                after(fault.length, process.proceed)
        elif fault.kind == "loss":
            self._lose(1)
            after(fault.length, lambda: self._lose(-1))
        elif fault.kind == "delay":
            simulation.hold(f"rt{fault.target}", fault.length)
        else:
            hosts = fault.target.split()
            simulation.cut(*hosts)
            after(fault.length, lambda: simulation.heal(*hosts))
        self.inflicted.append(fault)
        simulation.note(str(fault))

    def _lose(self, change: int) -> None:
        if not self._losses:
            self._before = self._simulation.network.loss
        self._losses += change
        self._simulation.network.loss = max(LOSS, self._before) if self._losses else self._before


def minimal(items: Sequence[T], fails: Callable[[Sequence[T]], bool]) -> Sequence[T]:
    """Return a part of the items that fails, and no longer does without any one of them.

    Source: A. Zeller, R. Hildebrandt, "Simplifying and Isolating Failure-Inducing Input", 2002 (ddmin).
    """
    parts = 2
    while len(items) >= 2:
        size = -(-len(items) // parts)
        chunks = [items[begin : begin + size] for begin in range(0, len(items), size)]
        rests = [
            [each for other in chunks if other is not chunk for each in other] for chunk in chunks
        ]  # of two chunks, each is the other's rest
        smaller = next((rest for rest in rests if fails(rest)), None)
        if smaller is not None:
            items, parts = smaller, max(parts - 1, 2)
        elif size == 1:
            break
        else:
            parts = min(2 * parts, len(items))
    return [] if len(items) == 1 and fails([]) else items
