"""Attacks: silences of the operator in which one fail-safe stands alone, so that no other one hides its bugs.

An attack takes two of the three fail-safes of deploy/SAFETY.md away:

- F1, the operator watchdog: it is killed, stopped or hung during the silence, so it loses its strikes.
- F2, the engine controller's timeout: a stranger reports the operator's presence. If F3 has to act, the
  controller is stopped, hung or slow when F2 has to act.
- F3, the drive's timeout: the drive keeps the last command.

Around the release, it disturbs the one that is left, so that messages are late when the last sign of life
passes. No random fault hits the processes of the fail-safes meanwhile.

Other attacks leave a claim alone on which a fail-safe rests: `turn_off` is repeated, although the first ones
are lost; a presence from the future counts for nothing; an `on` against another controller's `off` moves
nothing.
"""

from __future__ import annotations

import itertools
import random
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

from deploy.supervision import parameter_file
from deploy.supervision.reaction import BEAT, Reaction
from interfaces import topics
from tests.chaos.schedule import PlannedFault
from tests.chaos.schedule_file import Experiment
from tests.promises.history import (
    ALL,
    BAD_LINE,
    CONTROLLER,
    FALSE_PRESENCE,
    FUTURE_PRESENCE,
    HOLD,
    LOSE,
    NO_TARGET,
    OPERATOR,
    PARTITION,
    RIVAL,
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
from tests.promises.lateness import REDISCOVERY
from tests.promises.marks import STEP

FAIL_SAFES = ("F1", "F2", "F3")
REPEATED, FUTURE, VETO = "turn_off repeated", "presence from the future", "two controllers"
CLAIMS = (*FAIL_SAFES, REPEATED, FUTURE, VETO)
SHARE = 0.8  # of the silences that are long enough
HELD = 7.0  # s for which the operator holds the switch before
LONGEST_HOLD = 2.0  # s before a release, from which on messages are held
PREPARED = 6.0  # s before a release, from which on the fail-safes are unharmed
RECOVERY = 5.0  # s after a fault
CRITICAL = (WATCHDOG, CONTROLLER, SWITCH, OPERATOR, ALL, NO_TARGET)
"""The targets of random faults that would harm the fail-safe that is left."""


def judged(given: Reaction) -> float:
    """Return how long after a release the fail-safes are judged [s]."""
    return given.off_within + 0.8


def attacked(experiment: Experiment) -> Experiment:
    """Return an experiment in which most of the long silences are attacked, each fail-safe in turn."""
    rng = random.Random(f"attacks {experiment.seed}")
    given = parameter_file.reaction_to(experiment.parameters, "/")
    able = [claim for claim in CLAIMS if _can_stand_alone(claim, given)]
    turns = itertools.islice(itertools.cycle(able), rng.randrange(len(able)), None)
    until = judged(given)
    releases = [each for each in _releases(experiment, until) if rng.random() < SHARE]
    commands = [*experiment.scenario["engines"]]
    commands += [{"at": round(at - rng.uniform(1.2, 2.0), 3), "command": topics.TURN_ON} for at in releases]
    faults = [
        each for each in experiment.faults if not any(_harms(each, release, until) for release in releases)
    ]
    for release, claim in zip(releases, turns, strict=False):
        faults += attack(claim, release, given, rng)
    scenario = {**experiment.scenario, "engines": sorted(commands, key=lambda each: float(each["at"]))}
    return replace(experiment, scenario=scenario, faults=sorted(faults))


def attack(claim: str, release: float, given: Reaction, rng: random.Random) -> list[PlannedFault]:
    """Return the faults that leave a claim alone during the silence after a release [s]."""
    # The watchdog loses the strikes of earlier silences, so F1 does not act early.
    without_strikes = PlannedFault(-rng.uniform(4.0, 5.0), "kill", WATCHDOG)
    return [
        PlannedFault(round(release + at, 3), kind, target, round(duration, 3))
        for at, kind, target, duration in (without_strikes, *_ATTACKS[claim](given, rng))
    ]


def _can_stand_alone(claim: str, given: Reaction) -> bool:
    """Return whether a claim alone stops the engines within the bound of S1, by the parameters."""
    if claim == "F1":
        return given.by_strikes_in_time
    if claim == REPEATED:
        return _first_command(given) + given.watchdog.repeat + 0.2 < given.off_within
    return True


def _first_command(given: Reaction) -> float:
    """Return how long after a release the watchdog has commanded `turn_off` at the latest [s]."""
    return given.watchdog.strikes * given.watchdog.silence + given.watchdog.sampling + BEAT


def _releases(experiment: Experiment, least: float) -> Iterator[float]:
    """Yield each release after a long hold that begins a long silence."""
    pressed = experiment.scenario["operator"]["pressed"]
    for one, two in itertools.pairwise([*pressed, {"from": experiment.length}]):
        if one["to"] - one["from"] > HELD and two["from"] - one["to"] > least:
            yield one["to"]


def _harms(fault: PlannedFault, release: float, lasting: float) -> bool:
    recovery = REDISCOVERY if fault.kind == PARTITION else RECOVERY
    until = fault.at + fault.duration + recovery
    return fault.target in CRITICAL and fault.at < release + lasting and until > release - PREPARED


def _only_watchdog(given: Reaction, rng: random.Random) -> Iterator[PlannedFault]:
    yield PlannedFault(0.0, FALSE_PRESENCE, NO_TARGET, judged(given))
    yield PlannedFault(0.0, STUCK_DRIVE, NO_TARGET, judged(given))
    if rng.random() < 0.6:  # they come just before a strike
        late = (rng.randrange(given.watchdog.strikes) + rng.uniform(0.5, 0.63)) * given.watchdog.silence
        yield _held(topics.OPERATOR_HEARTBEAT, given, late)
    else:  # not both: of what arrives together, the newest is read, which may be nonsense
        yield _nonsense(given)
    yield from _disturbances(given, rng)


def _only_repetition(given: Reaction, rng: random.Random) -> Iterator[PlannedFault]:
    """Leave F1 alone, and lose its first commands."""
    yield PlannedFault(0.0, FALSE_PRESENCE, NO_TARGET, judged(given))
    yield PlannedFault(0.0, STUCK_DRIVE, NO_TARGET, judged(given))
    yield PlannedFault(0.0, LOSE, topics.ENGINES.name, _first_command(given) + 0.1)


def _only_present(given: Reaction, rng: random.Random) -> Iterator[PlannedFault]:
    """Leave F2 alone, with presences that are a little ahead of their time."""
    yield _without_watchdog(given, rng)
    yield PlannedFault(0.0, STUCK_DRIVE, NO_TARGET, judged(given))
    yield PlannedFault(0.0, FUTURE_PRESENCE, NO_TARGET, judged(given))


def _only_veto(given: Reaction, rng: random.Random) -> Iterator[PlannedFault]:
    """Start a second controller with the engines off, which contradicts the first one."""
    yield PlannedFault(-rng.uniform(0.5, 0.9), RIVAL, NO_TARGET, judged(given))


def _only_controller(given: Reaction, rng: random.Random) -> Iterator[PlannedFault]:
    """Leave F2 alone: the last heartbeat is nearly too old, and its presence late or received in a pause."""
    yield _without_watchdog(given, rng)
    yield PlannedFault(0.0, STUCK_DRIVE, NO_TARGET, judged(given))
    if rng.random() < 0.8:
        yield _held(topics.OPERATOR_HEARTBEAT, given, rng.uniform(0.64, 0.76) * given.watchdog.lifespan)
    if rng.random() < 0.5:
        late = rng.uniform(0.07, 0.27) * given.controller.presence_timeout
        yield _held(topics.OPERATOR_PRESENCE, given, late)
    else:
        yield _nonsense(given)
    if rng.random() < 0.5:  # for less than the drive's timeout, or it would turn off
        yield PlannedFault(rng.uniform(0.2, 0.4), "stop", CONTROLLER, rng.uniform(0.2, 0.28))
    yield from _disturbances(given, rng)


def _only_drive(given: Reaction, rng: random.Random) -> Iterator[PlannedFault]:
    """Leave F3 alone: the controller pauses or dies when F2 has to act."""
    yield _without_watchdog(given, rng)
    kind = rng.choice(("stop", "stop", "hang", "slow", "slow", "kill"))
    duration = {"stop": 3.0, "hang": 15.0, "slow": 3.0}.get(kind, 0.0)
    at = rng.uniform(0.86, 0.99) * given.controller.presence_timeout
    yield PlannedFault(at, kind, CONTROLLER, duration)
    yield _nonsense(given)
    yield from _disturbances(given, rng)


_ATTACKS = {
    "F1": _only_watchdog,
    "F2": _only_controller,
    "F3": _only_drive,
    REPEATED: _only_repetition,
    FUTURE: _only_present,
    VETO: _only_veto,
}


def _without_watchdog(given: Reaction, rng: random.Random) -> PlannedFault:
    """Make the watchdog lose its strikes so late that new ones come too late."""
    kind = rng.choice(("kill", "terminate", "raise", "stop", "hang"))
    duration = {"stop": 4.0, "hang": 15.0}.get(kind, 0.0)
    watchdog = given.watchdog
    earliest = watchdog.strikes * watchdog.silence - watchdog.sampling - 0.6 * watchdog.lifespan - BEAT
    return PlannedFault(rng.uniform(0.2, 1.0) * earliest, kind, WATCHDOG, duration)


def _held(topic: topics.Topic, given: Reaction, until: float) -> PlannedFault:
    """Hold the last messages before the release until so long after it [s].

    The watchdog, which was killed, hears some before: it has to see the operator until the release.
    """
    before = min(0.6 * given.watchdog.lifespan, LONGEST_HOLD)
    return PlannedFault(-before, HOLD, topic.name, before + until)


def _nonsense(given: Reaction) -> PlannedFault:
    return PlannedFault(0.2, "babble", NO_TARGET, judged(given))


def _disturbances(given: Reaction, rng: random.Random) -> Iterator[PlannedFault]:
    """Yield faults that no fail-safe may mind."""
    if rng.random() < 0.4:
        yield PlannedFault(-0.5, BAD_LINE, ALL, 1.5)
    if rng.random() < 0.3:
        yield PlannedFault(rng.uniform(0.3, 0.9) * given.controller.presence_timeout, STEP, NO_TARGET)


def alone(history: History) -> Counter[str]:
    """Return how often each fail-safe turned the engines off late in a silence while the others could not.

    And how often a repeated `turn_off` did, F2 against presences from the future, and another controller.
    """
    counted: Counter[str] = Counter()
    given = history.reaction.watchdog
    on = list(running(history))
    states = history.stream(topics.ENGINES_STATE)
    commands = [s for s in history.stream(topics.ENGINES) if s.value == topics.TURN_OFF]
    for begin, end in gaps([s.sent for s in history.signs_of_life()], 0.0, history.end):
        earliest = begin + given.strikes * given.silence - given.sampling
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
        lost = [each for each in history.faults if each.kind == LOSE and begin < each.end < last + BEAT]
        if is_off and is_commanded and is_stuck and is_deceived:
            counted[REPEATED if lost else "F1"] += 1
        elif is_off and not is_commanded and is_stuck:
            foretold = any(_is_active(fault, FUTURE_PRESENCE, last) for fault in history.faults)
            counted[FUTURE if foretold else "F2"] += 1
        elif not is_off and not is_commanded:
            counted["F3"] += 1
    for fault in history.faults:
        if fault.kind == RIVAL:
            said = [each.value for each in between(states, fault.begin, fault.end)]
            counted[VETO] += sum(pair == (topics.ON, topics.OFF) for pair in itertools.pairwise(said)) > 3
    return counted


def _is_active(fault: InjectedFault, kind: str, time: float) -> bool:
    return fault.kind == kind and fault.begin <= time < fault.end
