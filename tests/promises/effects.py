"""The effects that excuse a violation: one table, which every checker asks.

All verdicts rest on it: a violation is excused, or its outcome unknown, only if an effect covers it. An
effect concerns programs, from one time to another, for one reason. A fault does not excuse itself.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Collection, Iterable, Iterator
from enum import StrEnum, auto
from typing import NamedTuple

from interfaces import topics
from interfaces.service import states
from tests.promises import history as names
from tests.promises.history import (
    ALL,
    CONTROLLER,
    KINEMATICS,
    OPERATOR,
    ROBOT_STATE,
    SENTINEL,
    SOURCES,
    SWITCH,
    VELOCITY,
    WATCHDOG,
    History,
)
from tests.promises.lateness import MATCHED, REDISCOVERY
from tests.promises.limits import GAP, HUNG, SLOWEST
from tests.promises.marks import SPREAD, STEP


class Reason(StrEnum):
    """What an effect does to a program."""

    SILENT = auto()  # its output stops until it has recovered, or is mixed with injected messages
    WAITING = auto()  # it cannot start, because it needs the value of a silent program
    SUSPENDED = auto()  # it does nothing
    REPLACED = auto()  # a new process takes over, without the state of the old one
    DEAF = auto()  # no heartbeat, or no presence, counts
    OPPOSED = auto()  # another process says the opposite
    UNWATCHED = auto()  # the sentinel may not notice that it hangs
    CUT_OFF = auto()  # a value that it was sending may have reached only some readers
    DELAYED = auto()  # its messages take longer
    OVERLOADED = auto()  # the machine was too busy: it pauses, and the observer may miss its messages
    LOST = auto()  # the network may lose its messages to the observer
    UNDISCOVERED = auto()  # the observer may miss its messages, because it may not know their publisher yet
    LATE_START = auto()  # its messages are late without an overload, because readers may not know it yet
    STILL = auto()  # it has nothing to publish: its values do not change, or are not known yet


MISSED = (Reason.OVERLOADED, Reason.LOST)

# How long an effect lasts. All in seconds.
RESTARTED = 0.02  # a process may be noted to start so long before the last message of the one before
AT_ONCE = 0.001  # a fault so soon after a recovery may have come first
SENDING = 0.02  # a fault may interrupt what was sent so shortly before or after
NEW_SWITCH = 3.0  # from the start of a switch until the observer surely knows its publishers
FLOWING = 1.2  # a program without a message for so long is silent: the slowest output has 1 Hz
ORDER = 0.1  # the observer may receive a value so much later than a position that follows from it

# What checkers tolerate besides. All in seconds.
BEFORE = 1.0  # a fault or a missed message so long before a case may matter
DISCOVERY = 1.0  # from the observer's first message of a publisher until every reader knows that publisher
TRANSPORT, BAD_TRANSPORT = 0.15, 0.6  # a message may take so long on a busy machine, on a bad line
SAME = 0.01  # what happens at once may be sent in either order
REFUSING = 4.0  # within it, a supervisord has ended because there is another one
KILLING = 1.0  # from the injection of a kill to the death of the process
SETTLED = 0.5  # after a recovery until all programs downstream are right
LONGEST_PAUSE = 20.0  # a process may be suspended for so long, and its values become old

LASTING = ("stop", "pause", "hang", "hog", "slow", "crash_loop", "kill_all", "kill_supervisor")
"""After these faults, programs may be silent for as long as after a hang."""


class Effect(NamedTuple):
    """What a fault, a recorded condition or a start does to programs."""

    programs: Collection[str]
    """:data:`~tests.promises.history.ALL` stands for every program."""
    begin: float
    end: float
    """[s]. Both times are excluded."""
    why: Reason
    cause: object
    """The fault, the condition, the process that starts, or the history."""

    def concerns(self, program: str) -> bool:
        return program in self.programs or ALL in self.programs


def effects(history: History) -> list[Effect]:
    """Return everything that may excuse a violation."""
    return [*_of_faults(history), *_of_conditions(history), *_of_starts(history), *_of_silence(history)]


def _of_faults(history: History) -> Iterator[Effect]:
    for fault in history.faults:
        kind, target, begin, end = fault.kind, fault.target, fault.begin, fault.end
        replaced = history.effect_end(fault)  # the end, or earlier if the process was replaced
        recovery = HUNG if kind in LASTING else REDISCOVERY if kind == names.PARTITION else SLOWEST
        silent = (target, *names.DEPENDENTS.get(target, ()))
        yield Effect(silent, _from(begin), _to(replaced + recovery), Reason.SILENT, fault)
        if kind in names.FLOODS:
            silent = (SWITCH, *names.DEPENDENTS[SWITCH])
            yield Effect(silent, _from(begin), _to(end + recovery), Reason.SILENT, fault)
        if kind in names.SUSPENDING:
            yield Effect((target,), begin, replaced, Reason.SUSPENDED, fault)
            if target in (WATCHDOG, ALL):
                yield Effect((WATCHDOG,), begin, replaced, Reason.DEAF, fault)
        if kind == names.PARTITION:
            yield Effect((WATCHDOG,), begin, end + REDISCOVERY, Reason.DEAF, fault)
        is_away = kind in ("crash_loop", "kill_supervisor") and target in (WATCHDOG, ALL)
        if is_away and end + SLOWEST - begin > history.reaction.longest_restart:
            yield Effect((WATCHDOG,), begin, end + SLOWEST, Reason.DEAF, fault)
        if (kind, target) == (names.HOLD, topics.OPERATOR_HEARTBEAT.name):
            # They are too old when they arrive.
            yield Effect((WATCHDOG,), begin, end + history.reaction.watchdog.sampling, Reason.DEAF, fault)
            silent = (WATCHDOG, *names.DEPENDENTS[WATCHDOG])
            yield Effect(silent, _from(begin), _to(end + recovery), Reason.SILENT, fault)
        if (kind, target) == (names.HOLD, topics.OPERATOR_PRESENCE.name):
            # They are too old when they arrive.
            yield Effect((CONTROLLER,), begin, end, Reason.DEAF, fault)
        if kind == names.RIVAL:
            yield Effect((CONTROLLER,), begin, end + REDISCOVERY, Reason.OPPOSED, fault)
        if (kind, target) == (names.LOSE, topics.ENGINES.name):
            yield Effect((WATCHDOG, CONTROLLER), begin, end + SLOWEST, Reason.DELAYED, fault)
        if kind == STEP:  # while it spreads, clocks differ, and the age of a heartbeat is wrong
            yield Effect((WATCHDOG,), begin, begin + SPREAD, Reason.DEAF, fault)
            # It publishes values of one time, and waits again until the first ones are known. A speed needs
            # two positions whose stamps ascend.
            known = begin + SPREAD + states.LATENESS + states.GAP
            yield Effect((ROBOT_STATE, VELOCITY), begin, known, Reason.STILL, fault)
        if target in (SENTINEL, ALL):
            yield Effect((ALL,), begin - AT_ONCE, end, Reason.UNWATCHED, fault)
        if target in SOURCES:  # it sends a value to one reader after the other
            yield Effect((target,), begin - SENDING, begin + SENDING, Reason.CUT_OFF, fault)
        if kind == names.BAD_LINE:
            yield Effect((ALL,), begin, end, Reason.DELAYED, fault)
        is_short = history.reaction.watchdog.silence < 2 * BAD_TRANSPORT
        if is_short and kind in (names.BAD_LINE, *names.FLOODS):
            # It may delay, lose or hide as many heartbeats as a silence has.
            yield Effect((WATCHDOG,), begin, end + SLOWEST, Reason.DEAF, fault)


def _of_conditions(history: History) -> Iterator[Effect]:
    for condition in history.conditions:
        kind, begin, end = condition
        if kind == names.SILENCE:
            silent = (OPERATOR, *names.DEPENDENTS[OPERATOR])
            yield Effect(silent, _from(begin), _to(end + SLOWEST), Reason.SILENT, condition)
        else:
            why = Reason.OVERLOADED if kind == names.OVERLOAD else Reason.LOST
            yield Effect((ALL,), begin, end, why, condition)


def _of_starts(history: History) -> Iterator[Effect]:
    for life in history.lives:
        yield Effect((life.program,), life.began, life.began + MATCHED, Reason.LATE_START, life)
        if life.program in SOURCES:
            output = history.output(life.program)
            first = bisect_right(output, life.began, key=lambda s: s.sent)
            seen = output[first].sent if first < len(output) else math.inf
            yield Effect((life.program,), life.began, seen, Reason.UNDISCOVERED, life)
    for life in history.lives_of(SWITCH):
        yield Effect((SWITCH,), _from(life.began), life.began + NEW_SWITCH, Reason.UNDISCOVERED, life)
    for life in history.lives_of(CONTROLLER):
        yield Effect((CONTROLLER,), _from(life.began), life.began + RESTARTED, Reason.REPLACED, life)
    for life in history.lives_of(SENTINEL):  # it does not know yet how long the others have been silent
        others = {*history.programs} - {SENTINEL}
        yield Effect(others, life.began, life.began, Reason.UNWATCHED, life)


def _of_silence(history: History) -> Iterator[Effect]:
    yield Effect(SOURCES, history.end - ORDER, math.inf, Reason.UNDISCOVERED, history)
    for source in SOURCES:
        waiting = [program for program, needed in names.NEEDED_AT_START.items() if source in needed]
        times = (sample.sent for sample in history.output(source))
        for last, following in names.gaps(times, -math.inf, math.inf):
            # Short pauses first: they are many, and the rest takes long.
            if following - last > FLOWING and (since := _known_until(history, source, last)) < following:
                yield Effect(waiting, since, following, Reason.WAITING, history)
    sent = sorted(sample.sent for source in SOURCES for sample in history.output(source))
    for last, following in names.gaps(sent, -math.inf, math.inf):
        if following - last > GAP:
            yield Effect((KINEMATICS,), last, following, Reason.STILL, history)
    positions = history.stream(topics.EFFECTOR_POSITION)
    moves = (two.sent for one, two in itertools.pairwise(positions) if one.value != two.value)
    begin = positions[0].sent if positions else history.end
    for last, following in names.gaps(moves, begin, history.end):
        if following - last > GAP:
            yield Effect((VELOCITY,), last, following, Reason.STILL, history)


def _known_until(history: History, source: str, time: float) -> float:
    """Return until when new readers receive the value that a source sent at a time [s].

    Of a stream they receive the next values; a value that rarely changes is delivered while the source runs.
    """
    output = history.output(source)
    pauses = sorted(two.sent - one.sent for one, two in itertools.pairwise(output))
    if pauses and pauses[len(pauses) // 2] <= FLOWING:
        return time
    for life in history.lives_of(source):
        if life.began <= time and (life.ended is None or time <= life.ended):
            hits = (
                each.begin
                for each in history.faults
                if each.target == source and each.kind in names.SUSPENDING and each.end > time
            )
            return max(time, min([math.inf if life.ended is None else life.ended, *hits]))
    return time


def _from(time: float) -> float:
    return math.nextafter(time, -math.inf)


def _to(time: float) -> float:
    return math.nextafter(time, math.inf)


def disturbing(
    found: Iterable[Effect], program: str, begin: float, end: float, *why: Reason, but: object = None
) -> Iterator[Effect]:
    """Yield the effects on a program between two times for some reasons, without those of one cause."""
    for effect in found:
        overlaps = effect.begin < end and begin < effect.end
        if overlaps and effect.why in why and effect.cause is not but and effect.concerns(program):
            yield effect


def undisturbed(
    found: Iterable[Effect], program: str, begin: float, end: float, *why: Reason, but: object = None
) -> bool:
    """Return whether a program has no effect between two times for some reasons, but of one cause."""
    return next(disturbing(found, program, begin, end, *why, but=but), None) is None


def disturbed_for(found: Iterable[Effect], program: str, begin: float, end: float, *why: Reason) -> float:
    """Return how long [s] a program has effects between two times for some reasons."""
    parts = (
        (max(begin, each.begin), min(end, each.end)) for each in disturbing(found, program, begin, end, *why)
    )
    return sum(two - one for one, two in names.merged(parts))
