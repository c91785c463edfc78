"""Claims of deploy/SAFETY.md behind the promises: each yields what contradicts it in a history."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

from interfaces import topics
from interfaces.topics import DRIVE_TIMEOUT, INCAPACITATED, OFF, ON, TURN_OFF, TURN_ON
from tests.promises.effects import (
    BAD_TRANSPORT,
    KILLING,
    MISSED,
    RESTARTED,
    SAME,
    TRANSPORT,
    Effect,
    Reason,
    disturbing,
    undisturbed,
)
from tests.promises.findings import Evidence
from tests.promises.history import (
    ALL,
    CONTROLLER,
    DRIVE,
    NO_TARGET,
    OPERATOR,
    RIVAL,
    SENTINEL,
    SILENCE,
    SWITCH,
    WATCHDOG,
    Condition,
    History,
    Life,
    Sample,
    between,
    gaps,
    last_sent,
)
from tests.promises.lateness import MATCHED

CALM = (
    Reason.SILENT,
    Reason.DEAF,
    Reason.DELAYED,
    Reason.UNDISCOVERED,
    Reason.OPPOSED,
    Reason.LATE_START,
    *MISSED,
)
"""The effects that a program must not have, if all that it has to do is expected of it."""
SEEN = 1.0  # s more than a report of the operator takes, after which a `turn_on` has to be obeyed
REPLACING = 25.0  # s after the begin of a fault in which the sentinel or supervisord may end a process


def driven_time_never_goes_back(history: History) -> Iterator[Evidence]:
    """S6: a drive that is restarted goes on where the one before it stopped."""
    latest: dict[str, float] = {}
    for sample in history.stream(topics.DRIVEN_TIME):
        seconds, host = sample.value
        if (back := latest.get(host, seconds) - seconds) > 0.0:
            lives = [life for life in history.lives_of(DRIVE) if life.began <= sample.sent]
            since = f"process {lives[-1].pid} lives since {lives[-1].began:.2f} s" if lives else ""
            yield Evidence(sample.sent, f"the driven time goes back by {back:.2f} s", since)
        latest[host] = seconds


def drive_runs_by_a_young_on(history: History, found: Sequence[Effect]) -> Iterator[Evidence]:
    """S6: the driven time passes only by an `on` that is younger than 400 ms, and that no `off` opposes."""
    if history.lacks(SENTINEL):  # then this is one host of two, and the drive hears both controllers
        return
    states = history.stream(topics.ENGINES_STATE)
    delays = [each for each in found if each.why == Reason.DELAYED]
    for one, two in itertools.pairwise(history.stream(topics.DRIVEN_TIME)):
        passed = two.value[0] > one.value[0] and two.value[1] == one.value[1]
        if not passed or _has_young_on(history, delays, two.sent):
            continue
        if undisturbed(found, DRIVE, one.sent, two.sent, Reason.SILENT, *MISSED):
            last = last_sent(states, two.sent)
            since = f"{two.sent - last.sent:.2f} s after an {last.value}" if last else "without any state"
            yield Evidence(two.sent, f"the drive runs {since}")


def _has_young_on(history: History, delays: Sequence[Effect], time: float) -> bool:
    """Return whether a drive may run at a time by one of the states that it may have received last."""
    quick = undisturbed(delays, ALL, time - BAD_TRANSPORT, time, Reason.DELAYED)
    way = TRANSPORT if quick else BAD_TRANSPORT
    states = history.stream(topics.ENGINES_STATE)
    recent = between(states, time - DRIVE_TIMEOUT - SAME, time)
    # A new drive does not know an `off` of before, and may not have discovered a controller that says it.
    controllers = history.lives_of(CONTROLLER)
    is_new = any(time - MATCHED < life.began <= time for life in (*history.lives_of(DRIVE), *controllers))
    veto = way if is_new else DRIVE_TIMEOUT

    def counts(on: Sample) -> bool:
        offs = between(states, on.sent - veto + way, time - way)
        return on.value == ON and not any(each.value == OFF and must_know(on, each) for each in offs)

    rivals = [each.begin for each in history.faults if each.kind == RIVAL and time < each.begin + MATCHED]

    def must_know(on: Sample, off: Sample) -> bool:
        is_of_a_successor = any(on.sent - RESTARTED < life.began <= off.sent for life in controllers)
        return not is_of_a_successor and not any(began <= off.sent for began in rivals)

    return any(map(counts, recent))


def present_operator_is_obeyed(history: History, found: Sequence[Effect]) -> Iterator[Evidence]:
    """S3: a `turn_on` turns the engines on while the operator has been present for long enough."""
    given = history.reaction
    states, signs = history.stream(topics.ENGINES_STATE), history.signs_of_life()
    commands = history.stream(topics.ENGINES)
    period = 1.0 / float(given.switch.rate)
    before = given.watchdog.sampling + given.watchdog.reading + period + SEEN
    for command in commands:
        begin, end = command.sent - before, command.sent + 2 * TRANSPORT + given.controller.repeat
        if command.value != TURN_ON or end > history.end:
            continue
        if any(each.value == ON for each in between(states, command.sent - SAME, end)):
            continue
        offs = (each for each in between(commands, begin, end) if each.value == TURN_OFF)
        is_opposed = not all(is_of_watchdog(history, each) for each in offs)
        pauses = [two - one for one, two in gaps((s.sent for s in between(signs, begin, end)), begin, end)]
        seen = between(history.stream(topics.OPERATOR_PRESENCE), begin, command.sent)
        if is_opposed or max(pauses) > min(given.watchdog.lifespan, SEEN):
            continue  # the watchdog may have reported nobody, or reports somebody who came just now later
        if given.controller.max_presence_age < given.longest_unseen(max(period, *pauses)):
            continue  # the `turn_on` may come between two reports
        calm = _are_calm(found, (SWITCH, WATCHDOG, CONTROLLER), begin - 2 * before, end)
        if calm:
            why = "although the operator was reported" if seen else "and the operator was not reported"
            yield Evidence(command.sent, f"a turn_on of a present operator turned nothing on, {why}")


def is_of_watchdog(history: History, command: Sample) -> bool:
    """Return whether the watchdog commanded `turn_off`: it publishes its conclusion before that."""
    conclusion = last_sent(history.stream(topics.OPERATOR_ACTIVITY), command.sent)
    return conclusion is None or conclusion.value == INCAPACITATED


def _are_calm(found: Sequence[Effect], programs: Sequence[str], begin: float, end: float) -> bool:
    """Return whether nothing but the operator's silence disturbs programs."""
    disturbed = (each for program in programs for each in disturbing(found, program, begin, end, *CALM))
    return all(isinstance(each.cause, Condition) and each.cause.kind == SILENCE for each in disturbed)


def last_strike_stops(history: History, found: Sequence[Effect]) -> Iterator[Evidence]:
    """S1: the last silence turns the engines off, even if the operator returned between the silences."""
    given = history.reaction.watchdog
    late = given.lifespan + given.sampling + TRANSPORT
    commands = [each.sent for each in history.stream(topics.ENGINES) if each.value == TURN_OFF]
    starts = [life.began for life in history.lives_of(WATCHDOG)]
    states = history.stream(topics.ENGINES_STATE)
    begins: list[float] = []  # of the silences that count
    signs = [each.sent for each in history.signs_of_life()]
    for begin, end in gaps(signs, signs[0] if signs else history.end, history.end):
        for strike in range(1, 1 + int((end - begin - late) // given.silence)):
            due = begin + late + strike * given.silence
            begins.append(begin)
            if resets := [each for each in (*commands, *starts) if begins[0] < each <= due + TRANSPORT]:
                begins = [each for each in begins if each > max(resets)]
            elif len(begins) == given.strikes:
                runs = any(state.value == ON for state in between(states, due + TRANSPORT, due + 1.0))
                since = begins[0]
                both = (WATCHDOG, CONTROLLER)
                if runs and _are_calm(found, both, since, due + 1.0):
                    text = f"{given.strikes} silences since {since:.2f} s have not turned the engines off"
                    yield Evidence(due, text)
                begins = []


def ends_have_causes(history: History, found: Sequence[Effect]) -> Iterator[Evidence]:
    """L4: no process ends without a cause: a fault that hit it, or another instance."""
    for life in history.lives:
        if life.program not in history.programs or life.ended is None or life.ended >= history.end:
            continue
        if not _has_cause(history, found, life, life.ended):
            yield Evidence(life.ended, f"process {life.pid} of {life.program} ended without a cause")


def _has_cause(history: History, found: Sequence[Effect], life: Life, ended: float) -> bool:
    for fault in history.faults:
        if fault.target not in (life.program, ALL, NO_TARGET, OPERATOR):
            continue
        until = max(fault.end, history.effect_end(fault))  # a hang ends with its process
        if fault.begin - SAME <= ended <= until + REPLACING:
            return True
    if not undisturbed(found, ALL, ended - KILLING, ended, *MISSED):
        return True
    # It refused, because another one was there.
    others = (each for each in history.lives if each.program == life.program and each is not life)
    return any(
        each.began < ended - RESTARTED and (each.ended is None or each.ended > life.began + RESTARTED)
        for each in others
    )
