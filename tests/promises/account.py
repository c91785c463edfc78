"""What led to a violation, in at most six lines: which message of which process, and what had died."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

from interfaces import topics
from interfaces.topics import ALIVE, DRIVE_TIMEOUT, INCAPACITATED, MISSED, ON, TURN_OFF
from tests.promises.findings import Evidence
from tests.promises.history import (
    CONTROLLER,
    DRIVE,
    FALSE_PRESENCE,
    FUTURE_PRESENCE,
    KINEMATICS,
    SAID,
    STUCK_DRIVE,
    SWITCH,
    VELOCITY,
    WATCHDOG,
    History,
    Sample,
    between,
    last_sent,
    target_name,
)

BEFORE = 12.0  # s before a violation, in which a fault may have led to it
FAULTS = 5  # are listed
REPORT = 2.0  # s around a violation, in which a report of health may tell why
WORDS = 200  # characters of it
STILL = "still moved"
ABOUT = {
    "position": KINEMATICS,
    "published values": KINEMATICS,
    "speed": VELOCITY,
    "drive": DRIVE,
    "theta1": "config_theta1",
    "theta2": "config_theta2",
}
"""The programs that the words of a violation mean."""


def account(history: History, promise: str, evidence: Evidence) -> list[str]:
    """Return what the record shows about a violation."""
    if evidence.time >= history.end:  # the run exercised too little: that has no moment
        return []
    if promise == "S1" or STILL in evidence.text:
        beat = last_sent(history.signs_of_life(), evidence.time)
        since = beat.sent if beat else 0.0
        lines = [
            *_switch(history, beat),
            *_watchdog(history, since, evidence.time),
            *_controller(history, since, evidence.time),
            *(_heard(history, DRIVE, evidence.time) if STILL in evidence.text else ()),
            *_ended(history, history.programs, since - BEFORE / 2, evidence.time),
        ]
        return [*lines, *_faults(history, since - BEFORE / 2, evidence.time)]
    program = _subject(history, evidence.text)
    until = evidence.time
    if promise == "L2":  # a silence begins at its time
        until = next((each.sent for each in history.output(program) if each.sent > until), history.end)
    last = _values if program == KINEMATICS else _engines
    lines = [*_heard(history, program, evidence.time), *last(history, evidence.time)]
    lines += _ended(history, [program], evidence.time - BEFORE, evidence.time)
    return [*lines, *_faults(history, evidence.time - BEFORE, until)]


def _subject(history: History, text: str) -> str:
    """Return the program that a violation is about: the one that its words name first."""
    meant = {each: each for each in history.programs} | ABOUT
    named = [each for each in meant if each in text]
    return meant[min(named, key=text.index)] if named else CONTROLLER


def process(history: History, program: str, time: float) -> str:
    """Return a program with the process that it had at a time."""
    lives = [life for life in history.lives_of(program) if life.began <= time]
    return f"{program} ({lives[-1].pid})" if lives else program


def _switch(history: History, beat: Sample | None) -> Iterator[str]:
    if beat is None:
        yield f"{SWITCH} had sent no heartbeat"
    else:
        yield f"{process(history, SWITCH, beat.sent)} sent its last heartbeat at {beat.sent:.2f} s"


def _watchdog(history: History, since: float, due: float) -> Iterator[str]:
    """Yield when the watchdog counted its strikes, and which one it still needed.

    A return of the operator resets no strike, so those before it count.
    """
    given = history.reaction.watchdog
    began = max((life.began for life in history.lives_of(WATCHDOG) if life.began <= due), default=0.0)
    begin, is_successor = max(began, since), began > since
    commands = between(history.stream(topics.ENGINES), since, history.end)
    off = next((each.sent for each in commands if each.value == TURN_OFF), None)
    activity = between(history.stream(topics.OPERATOR_ACTIVITY), began, max(due, off or 0.0))
    ends = [n for n, each in enumerate(activity) if each.value == INCAPACITATED and each.sent < since]
    activity = activity[ends[-1] + 1 :] if ends else activity
    missed = [each.sent for each in activity if each.value == MISSED]
    strikes = [each for each in missed if each <= due]
    successor = f"the successor of {WATCHDOG} since {began:.2f} s"
    who = successor if is_successor else process(history, WATCHDOG, due)
    at = f", at {', '.join(f'{each:.1f}' for each in strikes[-given.strikes :])} s" if strikes else ""
    missing = given.strikes - len(strikes)
    if missing <= 0:
        away = next((each.sent for each in activity if each.value == INCAPACITATED), None)
        at += f", never {INCAPACITATED}" if away is None else f", {INCAPACITATED} at {away:.1f} s"
    else:
        at += f", the last one was due at {max([begin, *strikes]) + missing * given.silence:.2f} s"
    command = f"{TURN_OFF} came at {off:.2f} s" if off is not None else f"no {TURN_OFF} came"
    if len(missed) > given.strikes:
        command += f", after strike {len(missed)} at {missed[-1]:.1f} s"
    late = last_sent([each for each in activity if each.value == ALIVE], due)
    saw = f"saw the operator until {late.sent:.2f} s, and " if late and late.sent > since else ""
    yield f"{who} {saw}counted {len(strikes)} of {given.strikes} strikes until {due:.2f} s{at}; {command}"


def _controller(history: History, since: float, due: float) -> Iterator[str]:
    states = between(history.stream(topics.ENGINES_STATE), since, history.end)
    ons = list(itertools.takewhile(lambda state: state.value == ON, states))
    if not ons:
        yield f"{CONTROLLER} sent no on after that"
        return
    last = ons[-1].sent
    presence = last_sent(history.stream(topics.OPERATOR_PRESENCE), min(last, due))
    seen = "no presence had come"
    if presence:
        ends = presence.sent + history.reaction.controller.presence_timeout
        seen = f"the last presence had come at {presence.sent:.2f} s and counts until {ends:.2f} s at most"
    seen = f"until {due:.2f} s, {seen}"
    stop = f"the drive stops {1000 * DRIVE_TIMEOUT:.0f} ms later"
    injected = {each.kind for each in history.faults if each.begin <= last < each.end}
    if STUCK_DRIVE in injected:
        stop = "the drive kept it (injected)"
    if injected & {FALSE_PRESENCE, FUTURE_PRESENCE}:
        seen += ", and a stranger sent others (injected)"
    yield f"{process(history, CONTROLLER, last)} sent its last on at {last:.2f} s, {stop}; {seen}"


def _heard(history: History, program: str, time: float) -> Iterator[str]:
    """Yield the last messages of a program before a time, and the first one after it."""
    output = history.output(program)
    before = last_sent(output, time)
    after = next((each.sent for each in output if each.sent > time), None)
    heard = f"last at {before.sent:.2f} s" if before else "never before"
    again = f"again at {after:.2f} s" if after is not None else "never again"
    lives = [life.began for life in history.lives_of(program) if life.began <= time]
    successor = f", the successor since {lives[-1]:.2f} s," if len(lives) > 1 else ""
    said = _said(history, program, time)
    yield f"{process(history, program, time)}{successor} was heard {heard}, {again}{said}"


def _said(history: History, program: str, time: float) -> str:
    """Return the first warning in the health of a program around a time; empty if there is none."""
    reports = between(history.health(program), time - REPORT, time + REPORT)
    said = (dict(each.value[2:]).get(SAID) for each in reports)
    return next((f"; its health said: {each[:WORDS]}" for each in said if each), "")


def _ended(history: History, programs: Sequence[str], begin: float, time: float) -> Iterator[str]:
    """Yield the last line of the last process that ended by itself in a time."""
    ended = [
        (life.ended, life)
        for life in history.lives
        if life.program in programs and life.words and life.ended and begin <= life.ended <= time
    ]
    for when, life in ended[-1:]:
        yield f"{life.program} ({life.pid}) ended by itself at {when:.2f} s: {life.words[:WORDS]}"


def _values(history: History, time: float) -> Iterator[str]:
    """Yield the last position [m] before a time, and the lengths [m] and angles [rad] that it has to fit."""
    on = (topics.EFFECTOR_POSITION, *topics.CONFIGURATION.values())
    found = ((topic.name, last_sent(history.stream(topic), time)) for topic in on)
    values = [f"{name} {last.value} at {last.sent:.2f} s" for name, last in found if last]
    yield f"last values before: {', '.join(values) or 'none'}"


def _engines(history: History, time: float) -> Iterator[str]:
    """Yield the last message on each topic that moves or stops the engines, and the cause of the last one."""
    on = (topics.OPERATOR_HEARTBEAT, topics.OPERATOR_PRESENCE, topics.ENGINES, topics.ENGINES_STATE)
    found = ((topic.name, last_sent(history.stream(topic), time)) for topic in on)
    last_messages = [
        f"{name}{f' {last.value}' if isinstance(last.value, str) else ''} at {last.sent:.2f} s"
        for name, last in found
        if last
    ]
    if last_messages:
        yield f"last messages before: {', '.join(last_messages)}{_cause(history, time)}"


def _cause(history: History, time: float) -> str:
    """Return what the controller gave as the cause of the last state, after it began; empty if nothing."""
    states = [state for state in history.stream(topics.ENGINES_STATE) if state.sent <= time]
    same = list(itertools.takewhile(lambda state: state.value == states[-1].value, reversed(states)))
    begin = same[-1].sent if same else time
    causes = between(history.stream(topics.ENGINES_CAUSE), begin, begin + REPORT)
    return f", {causes[0].value}" if causes else ""


def _faults(history: History, begin: float, end: float) -> Iterator[str]:
    hits = [each for each in history.faults if each.begin <= end and each.end >= begin]
    listed = [f"{each.kind} of {target_name(each.target)} at {each.begin:.2f} s" for each in hits[-FAULTS:]]
    yield f"injected: {', '.join(listed)}" if listed else "nothing was injected"
