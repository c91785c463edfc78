"""Attacks: silences of the operator in which one fail-safe stands alone, so that no other one hides its bugs.

An attack takes two of the three fail-safes of deploy/SAFETY.md away:

- F1, the operator watchdog: it is killed, stopped or hung during the silence, so it loses its strikes.
- F2, the engine controller's timeout: a stranger reports the operator's presence. If F3 has to act, the
  controller is stopped, hung or slow when F2 has to act.
- F3, the drive's timeout: the drive keeps the last command.

Around the release, it disturbs the one that is left, so that messages are late when the last sign of life
passes. No random fault hits the processes of the fail-safes meanwhile.
"""

from __future__ import annotations

import itertools
import random
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

from deploy.promises.effects import REDISCOVERY, SAMPLING
from deploy.promises.history import (
    ALL,
    BAD_LINE,
    CONTROLLER,
    FALSE_PRESENCE,
    HOLD,
    NO_TARGET,
    OPERATOR,
    PARTITION,
    STUCK_DRIVE,
    SWITCH,
    WATCHDOG,
    History,
    InjectedFault,
    between,
    gaps,
    last_sent,
    running,
)
from deploy.promises.limits import OFF_WITHIN, STRIKE, STRIKES
from deploy.promises.marks import STEP
from deploy.trials.chaos.schedule import PlannedFault
from deploy.trials.chaos.schedule_file import Experiment
from interfaces import topics

FAIL_SAFES = ("F1", "F2", "F3")
SHARE = 0.8  # of the silences that are long enough
HELD = 7.0  # s for which the operator holds the switch before
PREPARED = 6.0  # s before a release, from which on the fail-safes are unharmed
JUDGED = OFF_WITHIN + 0.8  # s after a release, until which they are judged
RECOVERY = 5.0  # s after a fault
CRITICAL = (WATCHDOG, CONTROLLER, SWITCH, OPERATOR, ALL, NO_TARGET)
"""The targets of random faults that would harm the fail-safe that is left."""


def attacked(experiment: Experiment) -> Experiment:
    """Return an experiment in which most of the long silences are attacked, each fail-safe in turn."""
    rng = random.Random(f"attacks {experiment.seed}")
    turns = itertools.islice(itertools.cycle(FAIL_SAFES), rng.randrange(len(FAIL_SAFES)), None)
    releases = [each for each in _releases(experiment) if rng.random() < SHARE]
    commands = [*experiment.scenario["engines"]]
    commands += [{"at": round(at - rng.uniform(1.2, 2.0), 3), "command": topics.TURN_ON} for at in releases]
    faults = [each for each in experiment.faults if not any(_harms(each, release) for release in releases)]
    for release, fail_safe in zip(releases, turns, strict=False):
        faults += attack(fail_safe, release, rng)
    scenario = {**experiment.scenario, "engines": sorted(commands, key=lambda each: float(each["at"]))}
    return replace(experiment, scenario=scenario, faults=sorted(faults))


def attack(fail_safe: str, release: float, rng: random.Random) -> list[PlannedFault]:
    """Return the faults that leave a fail-safe alone during the silence after a release [s]."""
    # The watchdog loses the strikes of earlier silences, so F1 does not act early.
    without_strikes = PlannedFault(-rng.uniform(4.0, 5.0), "kill", WATCHDOG)
    return [
        PlannedFault(round(release + at, 3), kind, target, round(duration, 3))
        for at, kind, target, duration in (without_strikes, *_ATTACKS[fail_safe](rng))
    ]


def _releases(experiment: Experiment) -> Iterator[float]:
    """Yield each release after a long hold that begins a long silence."""
    pressed = experiment.scenario["operator"]["pressed"]
    for one, two in itertools.pairwise([*pressed, {"from": experiment.length}]):
        if one["to"] - one["from"] > HELD and two["from"] - one["to"] > JUDGED:
            yield one["to"]


def _harms(fault: PlannedFault, release: float) -> bool:
    recovery = REDISCOVERY if fault.kind == PARTITION else RECOVERY
    until = fault.at + fault.duration + recovery
    return fault.target in CRITICAL and fault.at < release + JUDGED and until > release - PREPARED


def _only_watchdog(rng: random.Random) -> Iterator[PlannedFault]:
    yield PlannedFault(2.0, FALSE_PRESENCE, NO_TARGET, JUDGED - 2.0)
    yield PlannedFault(0.0, STUCK_DRIVE, NO_TARGET, JUDGED)
    if rng.random() < 0.6:  # they come just before a strike
        late = rng.randrange(STRIKES) * STRIKE + rng.uniform(1.5, 1.9)
        yield PlannedFault(-0.3, HOLD, topics.OPERATOR_HEARTBEAT.name, 0.3 + late)
    else:  # not both: of what arrives together, the newest is read, which may be nonsense
        yield _nonsense()
    yield from _disturbances(rng)


def _only_controller(rng: random.Random) -> Iterator[PlannedFault]:
    """Leave F2 alone: the last heartbeat is nearly too old, and its presence late or received in a pause."""
    yield _without_watchdog(rng)
    yield PlannedFault(0.0, STUCK_DRIVE, NO_TARGET, JUDGED)
    if rng.random() < 0.8:
        yield PlannedFault(-0.3, HOLD, topics.OPERATOR_HEARTBEAT.name, rng.uniform(0.62, 0.68))
    if rng.random() < 0.5:
        yield PlannedFault(-0.3, HOLD, topics.OPERATOR_PRESENCE.name, rng.uniform(1.0, 3.0))
    else:
        yield _nonsense()
    if rng.random() < 0.5:  # for less than the drive's timeout, or it would turn off
        yield PlannedFault(rng.uniform(0.2, 0.4), "stop", CONTROLLER, rng.uniform(0.2, 0.28))
    yield from _disturbances(rng)


def _only_drive(rng: random.Random) -> Iterator[PlannedFault]:
    """Leave F3 alone: the controller pauses or dies when F2 has to act."""
    yield _without_watchdog(rng)
    kind = rng.choice(("stop", "stop", "hang", "slow", "slow", "kill"))
    duration = {"stop": 3.0, "hang": 15.0, "slow": 3.0}.get(kind, 0.0)
    yield PlannedFault(rng.uniform(8.6, 9.9), kind, CONTROLLER, duration)
    yield _nonsense()
    yield from _disturbances(rng)


_ATTACKS = dict(zip(FAIL_SAFES, (_only_watchdog, _only_controller, _only_drive), strict=True))


def _without_watchdog(rng: random.Random) -> PlannedFault:
    """Let the watchdog lose its strikes so late that three new ones come too late."""
    kind = rng.choice(("kill", "terminate", "raise", "stop", "hang"))
    return PlannedFault(rng.uniform(2.0, 8.5), kind, WATCHDOG, {"stop": 4.0, "hang": 15.0}.get(kind, 0.0))


def _nonsense() -> PlannedFault:
    return PlannedFault(0.2, "babble", NO_TARGET, JUDGED)


def _disturbances(rng: random.Random) -> Iterator[PlannedFault]:
    """Yield faults that no fail-safe may mind."""
    if rng.random() < 0.4:
        yield PlannedFault(-0.5, BAD_LINE, ALL, 1.5)
    if rng.random() < 0.3:
        yield PlannedFault(rng.uniform(3.0, 9.0), STEP, NO_TARGET)


def alone(history: History) -> Counter[str]:
    """Return how often each fail-safe turned the engines off late in a silence while the others could not."""
    counted: Counter[str] = Counter()
    on = list(running(history))
    states = history.stream(topics.ENGINES_STATE)
    commands = [s for s in history.stream(topics.ENGINES) if s.value == topics.TURN_OFF]
    for begin, end in gaps([s.sent for s in history.signs_of_life()], 0.0, history.end):
        earliest = begin + STRIKES * STRIKE - SAMPLING
        if end <= earliest:
            continue
        last = max((two for one, two in on if one < end), default=0.0)
        if not earliest <= last < end:
            continue
        state = last_sent(states, last)
        is_off = state is not None and state.value == topics.OFF
        is_commanded = bool(between(commands, begin, last))
        is_stuck, is_deceived = (
            any(_is_active(fault, kind, last) for fault in history.faults)
            for kind in (STUCK_DRIVE, FALSE_PRESENCE)
        )
        if is_off and is_commanded and is_stuck and is_deceived:
            counted["F1"] += 1
        elif is_off and not is_commanded and is_stuck:
            counted["F2"] += 1
        elif not is_off and not is_commanded:
            counted["F3"] += 1
    return counted


def _is_active(fault: InjectedFault, kind: str, time: float) -> bool:
    return fault.kind == kind and fault.begin <= time < fault.end
