"""The verdicts on random histories stay what they were before the table of effects: `verdicts.txt` has them.

After a wanted change of a promise, write them again:

    .venv/bin/python -m tests.promises.test_verdicts
"""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from interfaces.topics import OFF, TURN_OFF
from tests.promises.history import ALL, CONDITIONS, NO_TARGET, OPERATOR, Condition, History, InjectedFault
from tests.promises.promises import CHECKERS

from .histories import added, faulty, good, killed, silent, with_value

FILE = Path(__file__).with_name("verdicts.txt")
PROGRAMS = (
    "config_l1",
    "config_l2",
    "config_theta1",
    "config_theta2",
    "dead_mans_switch",
    "kinematics",
    "velocity",
    "operator_watchdog",
    "engine_controller",
    "robot_state",
    "operator_page",
    "sentinel",
)
"""Those that the arm had when the verdicts were written; a new service changes none of them."""
JUDGED = ("S1", "S2", "S3", "S5", "L1", "L3", "L4")
"""S4 takes long on these histories; L2 counts the streams of the contract, and S6 needs a drive."""
SUSPENDING = ("stop", "hang", "slow", "crash_loop")
LASTING = (*SUSPENDING, "partition", "bad_line", "flood", "overload", "loss", "stuck_drive")
TARGETS = {"partition": OPERATOR, "bad_line": ALL}
TOPICS = ("operator_heartbeat", "operator_presence", "engines/state", "effector/position", "/diagnostics")


def random_history(seed: int) -> History:
    """Return the good minute with kills, faults, silences and turned-off engines at random moments."""
    rng = random.Random(seed)

    def moment() -> float:
        return round(rng.uniform(8.0, 50.0), 3)

    history = good()
    for _ in range(rng.randrange(4)):
        history = killed(history, rng.choice(PROGRAMS), moment(), rng.choice((0.3, 0.8, 1.6, 2.6, 6.0)))
    for _ in range(rng.randrange(4)):
        kind, begin = rng.choice(LASTING), moment()
        programs = PROGRAMS if kind in SUSPENDING else (NO_TARGET,)
        target = TARGETS.get(kind, rng.choice(programs))
        pid = next((life.pid for life in history.lives if life.program == target), 0)
        end = begin + rng.choice((0.2, 1.0, 6.0))
        what = InjectedFault(kind, target, begin, end, pid)
        history = faulty(history, Condition(kind, begin, end) if kind in CONDITIONS else what)
    for _ in range(rng.randrange(3)):
        begin = moment()
        history = silent(history, rng.choice(TOPICS), begin, begin + rng.choice((0.5, 1.5, 6.0, 12.0)))
    if rng.random() < 0.5:
        begin = moment()
        history = with_value(history, "engines/state", OFF, begin, begin + rng.choice((0.3, 60.0)))
        if rng.random() < 0.5:
            history = added(history, "engines", (begin, TURN_OFF))
    return history


def verdicts(seed: int) -> list[str]:
    """Return a line for each promise, without pids: its verdict, its figures and its first evidence."""
    history = random_history(seed)
    findings = [check(history) for promise, check in CHECKERS.items() if promise in JUDGED]
    lines = [
        f"{seed} {each.promise} {each.verdict} {each.cases} {each.unknown} {len(each.evidence)}: "
        f"{each.measured}; {each.evidence[0].text if each.evidence else ''}".rstrip("; ")
        for each in findings
        if each.cases or each.unknown or each.evidence
    ]
    return [re.sub(r"processes \d+ and \d+", "two processes", line) for line in lines]


RECORDED = FILE.read_text(encoding="utf-8").splitlines() if FILE.exists() else []
SEEDS = range(20)


@pytest.mark.parametrize("seed", SEEDS)
def test_verdicts_on_a_random_history_stay(seed: int) -> None:
    assert verdicts(seed) == [line for line in RECORDED if line.startswith(f"{seed} ")]


if __name__ == "__main__":
    FILE.write_text("".join(f"{line}\n" for seed in SEEDS for line in verdicts(seed)), encoding="utf-8")
