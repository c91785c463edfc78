"""Who is hit when: named scenarios, and a monkey that throws dice. Pure: the same seed, the same schedule."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from deploy.chaos.faults import FAULTS
from deploy.chaos.history import ALL, NOTHING, PROGRAMS

PERIOD = 45.0  # s of the operator's day
AWAKE = 30.0  # s of it in which the switch is held
SETTLE = 5.0  # s after the last fault
FIRST = 5.0  # s until the first fault: by then the engines are on


class Planned(NamedTuple):
    """A fault to come."""

    at: float
    """[s since the operator's day began]"""
    kind: str
    target: str
    lasting: float = 0.0


Schedule = Sequence[Planned]


def monkey(
    seed: int,
    duration: float,
    *,
    every: float = 5.0,
    kinds: Iterable[str] = tuple(FAULTS),
    targets: Iterable[str] = (),
) -> Schedule:
    """
    Throw dice: a fault of any kind, of anything that it can be done to, each `every` [s], give or take half.

    :param targets: only these, besides what is done to the arm as a whole; empty for all.
    """
    rng = random.Random(seed)
    kinds = [kind for kind in sorted(kinds) for _ in range(OFTEN.get(kind, 1))]
    wanted = set(targets)
    planned = []
    for step in range(int((duration - FIRST) / every)):
        kind = rng.choice(kinds)
        fault = FAULTS[kind]
        allowed = [t for t in fault.targets if not wanted or t in wanted or t not in PROGRAMS]
        at = FIRST + every * (step + rng.uniform(0.0, 0.5))
        target = rng.choice(allowed) if allowed else ""
        lasting = rng.uniform(*fault.lasting)
        if target:
            planned.append(Planned(round(at, 3), kind, target, round(lasting, 3)))
    return planned


OFTEN = {"kill": 6, "stop": 3, "hang": 2}
"""How much more often the monkey does it than other things."""

ORDER = (
    *("kinematics", "dead_mans_switch", "config_l1", "config_l2", "sentinel"),
    *("config_theta1", "config_theta2", "engine_controller", "velocity", "operator_watchdog"),
)
"""All programs; each long after the one that it depends on."""


def kill_each(times: int = 20, pause: float = 0.8) -> Schedule:
    """SIGKILL every program so many times, one after the other."""
    round_ = [program for _ in range(times) for program in ORDER]
    return [Planned(FIRST + pause * n, "kill", program) for n, program in enumerate(round_)]


def hang_each(pause: float = 7.0) -> Schedule:
    """Hang every program once by an endless loop, and once by SIGSTOP."""
    each = [(kind, program) for kind in ("hang", "stop") for program in ORDER]
    return [Planned(FIRST + pause * n, kind, program, 15.0) for n, (kind, program) in enumerate(each)]


def kill_watchdog() -> Schedule:
    """Kill the operator watchdog every 2 s, for a day of the operator: it never counts to three strikes."""
    return [Planned(at, "kill", "operator_watchdog") for at in _every(2.0, FIRST, PERIOD)]


def kill_controller() -> Schedule:
    """Kill the engine controller while the engines are on."""
    return [Planned(at, "kill", "engine_controller") for at in _every(9.0, FIRST + 2.0, AWAKE)]


def stop_controller() -> Schedule:
    """Stop the engine controller just before it would turn off, when the watchdog has lost its strikes."""
    return [
        Planned(AWAKE + 5.0, "kill", "operator_watchdog"),
        Planned(AWAKE + 9.4, "stop", "engine_controller", 4.0),
    ]


def kill_supervisor() -> Schedule:
    """Kill supervisord, and start it again over its orphans, of which one is killed meanwhile."""
    return [
        Planned(8.0, "kill_supervisor", ALL, 3.0),
        Planned(9.5, "kill", "kinematics"),
        Planned(20.0, "kill_supervisor", ALL, 1.0),
    ]


def nonsense() -> Schedule:
    """Flood, babble, doubles and a full disk, with kills meanwhile."""
    return [
        Planned(6.0, "flood", NOTHING, 6.0),
        Planned(9.0, "kill", "operator_watchdog"),
        Planned(14.0, "babble", NOTHING, 10.0),
        Planned(17.0, "kill", "kinematics"),
        Planned(21.0, "kill", "velocity"),
        Planned(26.0, "full_disk", NOTHING, 8.0),
        Planned(29.0, "kill", "config_theta1"),
        Planned(32.0, "double", "engine_controller", 6.0),
    ]


def briefly() -> Schedule:
    """Kill every program three times; then the operator sleeps, and the watchdog is killed every 2 s."""
    return [*kill_each(3), *(Planned(at, "kill", "operator_watchdog") for at in _every(2.0, AWAKE, PERIOD))]


def variously() -> Schedule:
    """All other faults once, ending with a controller that is stopped while it should act."""
    return [
        Planned(5.0, "hang", "kinematics", 15.0),
        Planned(5.5, "double", "engine_controller", 6.0),
        Planned(8.0, "terminate", "config_l2"),
        Planned(9.0, "raise", "config_theta1"),
        Planned(9.5, "stop", "config_l1", 15.0),
        Planned(11.0, "hog", "velocity"),
        Planned(12.0, "crash_loop", "config_l2", 3.0),
        Planned(13.0, "flood", NOTHING, 5.0),
        Planned(15.0, "kill", "operator_watchdog"),
        Planned(18.0, "babble", NOTHING, 7.0),
        Planned(20.0, "kill", "kinematics"),
        Planned(20.5, "stop", "sentinel", 15.0),
        Planned(26.0, "full_disk", NOTHING, 4.0),
        Planned(27.0, "kill", "config_theta1"),
        *stop_controller(),
        Planned(AWAKE + 14.0, "kill_supervisor", ALL, 1.0),
    ]


def everything() -> Schedule:
    """Every fault for every program that it applies to."""
    each = [(kind, target) for kind, fault in FAULTS.items() for target in fault.targets]
    planned, at = [], FIRST
    for kind, target in each:
        lasting = min(FAULTS[kind].lasting[1], 6.0)
        planned.append(Planned(at, kind, target, lasting))
        at += max(3.5, lasting + 1.0)
    return planned


def complete() -> Schedule:
    """All the named scenarios, one after the other; each begins with a day of the operator."""
    planned, begin = [], 0.0
    for name, scenario in NAMED.items():
        if name != "complete":
            planned += [each._replace(at=begin + each.at) for each in scenario()]
            begin = math.ceil((planned[-1].at + SETTLE) / PERIOD) * PERIOD
    return planned


def _every(period: float, begin: float, end: float) -> list[float]:
    return list(itertools.takewhile(lambda at: at < end, itertools.count(begin, period)))


NAMED: dict[str, Callable[[], Schedule]] = {
    function.__name__: function
    for function in (
        kill_each,
        hang_each,
        kill_watchdog,
        kill_controller,
        stop_controller,
        kill_supervisor,
        nonsense,
        briefly,
        variously,
        everything,
        complete,
    )
}
"""The named scenarios."""


def duration(schedule: Schedule) -> float:
    """How long a schedule takes, with the time to settle after its last fault [s]."""
    return max((planned.at + planned.lasting for planned in schedule), default=0.0) + SETTLE
