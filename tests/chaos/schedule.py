"""When which fault is injected into which target: named scenarios, and random schedules from a seed."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from tests.chaos import clock
from tests.chaos.faults import FAULT_KINDS, PROGRAMS
from tests.promises.history import ALL, NO_TARGET
from tests.promises.limits import HUNG
from tests.promises.marks import STEP

DAY = 45.0  # s after which the operator's scenario repeats
AWAKE = 30.0  # s of each day in which the operator holds the switch
SETTLE = 8.0  # s after the last fault: also on a busy machine, the whole system restarts in less
FIRST_FAULT = 5.0  # s until the first fault: the engines are on by then
PAUSE = 1.0  # s between two kills: a restart that keeps the median of L1 has ended before the next one

WEIGHTS = {"kill": 6, "stop": 3, "hang": 2}
"""How often the random schedule picks a kind, in relation to the other kinds."""

ROUND = PROGRAMS[::2] + PROGRAMS[1::2]
"""All programs. Neighbours in the manifest, which often depend on each other, are far apart."""


class PlannedFault(NamedTuple):
    at: float
    """[s] since the beginning of the operator's day."""
    kind: str
    target: str
    duration: float = 0.0
    """[s]; 0 for a momentary fault."""


Schedule = Sequence[PlannedFault]


def random_faults(
    seed: int | str,
    duration: float,
    *,
    every: float = 5.0,
    kinds: Iterable[str] = tuple(FAULT_KINDS),
    table: Mapping[str, Any] = FAULT_KINDS,
) -> Schedule:
    """Return a random fault of a table of kinds in each interval of ``every`` [s], the same for a seed.

    The simulation kit draws its faults during a run, from what lives then; these are drawn before it, because
    attacks replace some, and a real arm gets them too, in whose interpreter the kit cannot be imported.
    """
    rng = random.Random(seed)
    kinds = [kind for kind in sorted(kinds) for _ in range(WEIGHTS.get(kind, 1))]
    planned = []
    for step in range(int((duration - FIRST_FAULT) / every)):
        kind = rng.choice(kinds)
        at = FIRST_FAULT + every * (step + rng.uniform(0.0, 0.5))
        lasting = rng.uniform(*table[kind].duration)
        planned.append(PlannedFault(round(at, 3), kind, rng.choice(table[kind].targets), round(lasting, 3)))
    return planned


def possible(planned: Schedule) -> Schedule:
    """Return the faults that this machine can have."""
    return [each for each in planned if each.kind != STEP or not clock.missing()]


def kill_each(times: int = 20) -> Schedule:
    """SIGKILL every program ``times`` times, one after the other."""
    targets = [program for _ in range(times) for program in ROUND]
    return [PlannedFault(FIRST_FAULT + PAUSE * n, "kill", target) for n, target in enumerate(targets)]


def hang_each(pause: float = 7.0) -> Schedule:
    """Hang every program once in an endless loop, and once by SIGSTOP."""
    each = [(kind, program) for kind in ("hang", "stop") for program in ROUND]
    return [
        PlannedFault(FIRST_FAULT + pause * n, kind, program, 15.0) for n, (kind, program) in enumerate(each)
    ]


def kill_watchdog() -> Schedule:
    """Kill the operator watchdog every 2 s for a day: it never counts three strikes."""
    return _kill_every(2.0, FIRST_FAULT, DAY, "operator_watchdog")


def kill_controller() -> Schedule:
    """Kill the engine controller while the engines are on."""
    return _kill_every(9.0, FIRST_FAULT + 2.0, AWAKE, "engine_controller")


def stop_controller() -> Schedule:
    """Stop the engine controller just before it turns off; the watchdog has lost its strikes."""
    return [
        PlannedFault(AWAKE + 5.0, "kill", "operator_watchdog"),
        PlannedFault(AWAKE + 9.4, "stop", "engine_controller", 4.0),
    ]


def kill_supervisor() -> Schedule:
    """Kill supervisord twice and start it again over its orphans; one of them is killed meanwhile."""
    return [
        PlannedFault(8.0, "kill_supervisor", ALL, 3.0),
        PlannedFault(9.5, "kill", "kinematics"),
        PlannedFault(20.0, "kill_supervisor", ALL, 1.0),
    ]


def nonsense() -> Schedule:
    """Flood, babble, a full disk and a duplicate, with kills meanwhile."""
    return [
        PlannedFault(6.0, "flood", NO_TARGET, 6.0),
        PlannedFault(9.0, "kill", "operator_watchdog"),
        PlannedFault(14.0, "babble", NO_TARGET, 10.0),
        PlannedFault(17.0, "kill", "kinematics"),
        PlannedFault(21.0, "kill", "velocity"),
        PlannedFault(26.0, "full_disk", NO_TARGET, 8.0),
        PlannedFault(29.0, "kill", "config_theta1"),
        PlannedFault(32.0, "double", "engine_controller", 6.0),
    ]


def briefly() -> Schedule:
    """Kill every program three times in the days; in the first night, only the watchdog."""
    rounds = int((AWAKE - FIRST_FAULT) / PAUSE) // len(ROUND)  # that a day has time for
    days = [kill_each(rounds)] * (3 // rounds) + [kill_each(3 % rounds)]
    first, *others = [[kill._replace(at=DAY * n + kill.at) for kill in day] for n, day in enumerate(days)]
    return [*first, *_kill_every(2.0, AWAKE, DAY, "operator_watchdog"), *itertools.chain(*others)]


def variously() -> Schedule:
    """Inject every kind of fault and kill every program; stop the controller when it has to act."""
    planned = [
        PlannedFault(5.0, "hang", "kinematics", 15.0),
        PlannedFault(5.5, "double", "engine_controller", 6.0),
        PlannedFault(8.0, "terminate", "config_l2"),
        PlannedFault(9.0, "raise", "config_theta1"),
        PlannedFault(9.5, "stop", "config_l1", 15.0),
        PlannedFault(11.0, "hog", "velocity"),
        PlannedFault(12.0, "crash_loop", "config_l2", 3.0),
        PlannedFault(13.0, "flood", NO_TARGET, 5.0),
        PlannedFault(15.0, "kill", "operator_watchdog"),
        PlannedFault(18.0, "babble", NO_TARGET, 7.0),
        PlannedFault(18.5, "kill", "engine_controller"),
        PlannedFault(20.5, "stop", "sentinel", 15.0),
        PlannedFault(22.0, "kill", "twist"),
        PlannedFault(23.0, STEP, NO_TARGET),
        PlannedFault(24.0, "kill", "drive"),
        PlannedFault(25.2, "kill", "kinematics"),  # config_l2, for which it may wait, is back
        PlannedFault(26.0, "full_disk", NO_TARGET, 4.0),
        PlannedFault(26.5, "kill", "config_theta1"),
        PlannedFault(27.2, "kill", "operator_watchdog"),
        PlannedFault(27.8, "kill", "robot_state"),
        PlannedFault(28.6, "kill", "dead_mans_switch"),
        PlannedFault(30.0, "kill", "config_l1"),
        PlannedFault(31.0, "kill", "operator_page"),
        PlannedFault(32.0, "kill", "config_l2"),
        PlannedFault(33.0, "kill", "velocity"),
        PlannedFault(34.0, "kill", "config_theta2"),
        PlannedFault(AWAKE + 6.5, STEP, NO_TARGET),
        *stop_controller(),
        PlannedFault(AWAKE + 7.0, "kill", "sentinel"),
        PlannedFault(AWAKE + 14.0, "kill_supervisor", ALL, 1.0),
        PlannedFault(AWAKE + 19.0, "kill_all", ALL),
    ]
    killed = {each.target for each in planned if each.kind == "kill"}
    own = [program for program in ROUND if program not in killed]  # of `make new-service`
    begin = planned[-1].at + HUNG + PAUSE  # before, kill_all explains each silence
    planned += [PlannedFault(begin + PAUSE * n, "kill", program) for n, program in enumerate(own)]
    return planned


def everything() -> Schedule:
    """Inject every kind of fault into each of its targets."""
    planned, at = [], FIRST_FAULT
    for kind, fault in FAULT_KINDS.items():
        for target in fault.targets:
            lasting = min(fault.duration[1], 6.0)
            planned.append(PlannedFault(at, kind, target, lasting))
            at += max(3.5, lasting + 1.0)
    return planned


def complete() -> Schedule:
    """All named scenarios, one after the other; each begins with a day of the operator."""
    planned, begin = [], 0.0
    for name, scenario in SCENARIOS.items():
        if name != "complete":
            planned += [each._replace(at=begin + each.at) for each in scenario()]
            begin = math.ceil((planned[-1].at + SETTLE) / DAY) * DAY
    return planned


def _kill_every(period: float, begin: float, end: float, program: str) -> list[PlannedFault]:
    times = itertools.takewhile(lambda at: at < end, itertools.count(begin, period))
    return [PlannedFault(at, "kill", program) for at in times]


SCENARIOS: dict[str, Callable[[], Schedule]] = {
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


def duration(schedule: Schedule) -> float:
    """Return how long a schedule takes, with the time to settle after its last fault [s]."""
    return max((planned.at + planned.duration for planned in schedule), default=0.0) + SETTLE
