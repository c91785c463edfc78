"""When the recorded processes lived, when they were suspended, and what they knew when the record began."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import islice
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import deserialize_message
from rclpy_simulation.host import SECOND
from rclpy_simulation.replay.lives import Suspension

from interfaces.activity import READING
from interfaces.service.health import reported_parameters
from interfaces.service.parameters import declarations
from interfaces.topics import (
    ALIVE,
    CONTRACT,
    DIAGNOSTICS,
    ENGINES_STATE,
    INCAPACITATED,
    MISSED,
    OFF,
    OPERATOR_ACTIVITY,
    OPERATOR_PRESENCE,
    ROBOT_DESCRIPTION,
    Topic,
)
from services import engine_controller, operator_watchdog, robot_state
from tests.promises.observations import FAULTS, PROCESSES
from tests.replay.record import Message, Record, text

AHEAD = SECOND // 2
"""By which a process that is older than the record starts before it, to discover its inputs [ns]."""
LATE = SECOND // 20
"""By which a process outlives its last message, as timers of a replay may be late [ns]."""
YOUNG = 2 * SECOND
"""A watchdog of this age [ns] has no strike yet, and the controller forgets a presence sooner."""
SUSPENDING = ("stop", "slow")

_WATCHDOG = operator_watchdog.DEFAULTS
_TIMERS: dict[str, tuple[Topic, float, float]] = {
    "operator_watchdog": (OPERATOR_ACTIVITY, _WATCHDOG.sampling, READING),
    "engine_controller": (ENGINES_STATE, engine_controller.DEFAULTS.repeat, 0.0),
    "robot_state": (ROBOT_DESCRIPTION, robot_state.DESCRIPTION_PERIOD, 0.0),
}
"""Topics that show when the timer of a service began, with its period and its first delay [s]."""


class ReplayedLife(NamedTuple):
    """The life of a process of a service. Times: ns since 1970."""

    began: int
    """When it began its work."""
    ended: int | None
    """``None`` if it outlived the record."""
    suspensions: tuple[Suspension, ...] = ()
    parameters: Mapping[str, Any] = {}
    """Those that were not the default."""
    has_past: bool = False
    """Whether it is older than the record."""


class _Seen(NamedTuple):
    created: int
    """When its node was created."""
    last: int
    """When it sent the last report."""
    parameters: Mapping[str, Any]
    """Those that are not the default."""


def lives(record: Record, namespace: str, service: str) -> list[ReplayedLife]:
    """Return the lives of a service's processes.

    Each health report has the process and how long its node exists. A process that the chaos monkey saw
    end, or that has a successor, ends with its last message: a hung process is as good as dead.
    """
    ends, suspensions = _ends(record, namespace), _suspensions(record, namespace)
    seen = sorted(_seen(record, namespace, service).items(), key=lambda item: item[1].created)
    found = []
    for number, (pid, process) in enumerate(seen):
        following = seen[number + 1][1].created if number + 1 < len(seen) else None
        known = [time for time in (ends.get(pid), following) if time is not None]
        ended = _last_message(record, namespace, service, process, min(known)) if known else None
        began = _begin_of_work(record, namespace, service, max(process.created, record.begin - AHEAD))
        if ended is None or ended > began:
            suspended = tuple(suspensions.get(pid, ()))
            has_past = process.created < record.begin - YOUNG
            found.append(ReplayedLife(began, ended, suspended, process.parameters, has_past))
    if not found:
        began = _begin_of_work(record, namespace, service, record.begin - AHEAD)
        found.append(ReplayedLife(began, None, has_past=True))
    return found


def _seen(record: Record, namespace: str, service: str) -> dict[int, _Seen]:
    found: dict[int, _Seen] = {}

    def note(sent: int, status: DiagnosticStatus) -> None:
        values = {pair.key: pair.value for pair in status.values}
        pid, created = int(values["pid"]), sent - round(float(values["uptime"]) * SECOND)
        created = found[pid].created if pid in found else created
        found[pid] = _Seen(created, sent, reported_parameters(status))

    read_reports(record, namespace, service, note)
    return found


def read_reports(
    record: Record, namespace: str, service: str, read: Callable[[int, DiagnosticStatus], None]
) -> None:
    """Call a function with the health reports of a service, and when each was sent [ns since 1970]."""
    name = f"{namespace.rstrip('/')}/{service}"
    for sent, data in record.of(DIAGNOSTICS, namespace):
        if name.encode() not in data:
            continue
        try:
            for status in deserialize_message(data, DIAGNOSTICS.type).status:
                if status.name == name and any(pair.key == "uptime" for pair in status.values):
                    read(sent, status)
        except Exception:  # of any type: the message is no report of ours
            continue


def _begin_of_work(record: Record, namespace: str, service: str, created: int) -> int:
    """Return when a process began its timer: after the creation of its node, in the phase of its output."""
    if service not in _TIMERS:
        return created
    topic, period, first = _TIMERS[service]
    messages = record.of(topic, namespace)
    index = bisect_left(messages, created, key=_sent)
    if index == len(messages):
        return created
    if topic is OPERATOR_ACTIVITY and text(messages[index], OPERATOR_ACTIVITY) == MISSED:
        first = _WATCHDOG.silence
    return created + (messages[index].sent - round(first * SECOND) - created) % round(period * SECOND)


def origin(record: Record, namespace: str, life: ReplayedLife) -> int:
    """Return when the first watchdog began to expect the operator [ns since 1970].

    A record does not contain it. One with a past began so early that it has the strikes which the record
    shows: for each of them, a silence before the record is made up.
    """
    given = _watchdog_parameters(life)
    sampling, silence = round(given.sampling * SECOND), round(given.silence * SECOND)
    if begins_away(record, namespace, life):
        return record.begin - given.strikes * silence - sampling
    conclusions = _conclusions(record, namespace, life)
    if not conclusions:
        return record.begin
    sent, first = conclusions[0]
    if not life.has_past:
        return sent - (silence if first == MISSED else sampling)
    strikes = _strikes_before(conclusions, given.strikes)
    if first != ALIVE:
        return sent - (strikes + 1 if first == MISSED else given.strikes) * silence
    samples = min((sent - record.begin) // sampling + 1, (silence - 1) // sampling)
    return sent - samples * sampling - strikes * silence


def begins_away(record: Record, namespace: str, life: ReplayedLife) -> bool:
    """Return whether the operator is incapacitated when the record begins: a watchdog is silent only then."""
    given = _watchdog_parameters(life)
    longest = round((given.silence + given.sampling) * SECOND)
    conclusions = _conclusions(record, namespace, life)
    if not life.has_past or (conclusions and conclusions[0][1] != ALIVE):
        return False
    end = record.end if life.ended is None else life.ended
    return (conclusions[0][0] if conclusions else end) - record.begin > longest


def _watchdog_parameters(life: ReplayedLife) -> operator_watchdog.Parameters:
    known = {each.name: each for each in declarations(operator_watchdog.Parameters)}
    values = life.parameters.items()
    legal = {name: value for name, value in values if name in known and not known[name].problem(value)}
    return replace(_WATCHDOG, **legal)


def _conclusions(record: Record, namespace: str, life: ReplayedLife) -> list[tuple[int, str]]:
    end = record.end if life.ended is None else life.ended
    return [
        (message.sent, text(message, OPERATOR_ACTIVITY))
        for message in record.of(OPERATOR_ACTIVITY, namespace)
        if record.begin <= message.sent <= end
    ]


def _strikes_before(conclusions: list[tuple[int, str]], strikes: int) -> int:
    """Return how many strikes came before the record; none if it does not show the last one."""
    names = [name for _, name in conclusions]
    if INCAPACITATED not in names:
        return 0
    return max(0, strikes - names[: names.index(INCAPACITATED)].count(MISSED))


class Latch(NamedTuple):
    """What the record shows first of the latch."""

    known: int
    """When it is known [ns since 1970]."""
    engines: str
    operator_is_present: bool


def latch(record: Record, namespace: str, life: ReplayedLife) -> Latch | None:
    """Return what the record shows first of the latch of a controller; ``None`` if it shows nothing.

    The latch has two parts. The engines' state is repeated. The time of the last presence is known once there
    is another presence, or once the engines are off for so long that no former presence turns them on.
    """
    end = record.end if life.ended is None else life.ended
    states = [each for each in record.of(ENGINES_STATE, namespace) if record.begin <= each.sent <= end]
    present = [each for each in record.of(OPERATOR_PRESENCE, namespace) if record.begin <= each.sent <= end]
    found = []
    if states and present:
        known = max(states[0].sent, present[0].sent)
        engines = text([each for each in states if each.sent <= known][-1], ENGINES_STATE)
        found.append(Latch(known, engines, True))
    off = (
        Latch(each.sent, OFF, False)
        for each in states
        if each.sent >= record.begin + YOUNG and text(each, ENGINES_STATE) == OFF
    )
    return min([*found, *islice(off, 1)], default=None)


def _last_message(record: Record, namespace: str, service: str, process: _Seen, before: int) -> int:
    """Return the end of a process that ended at a time, or earlier: just after its last message."""
    last = process.last
    for topic in CONTRACT:
        if topic.publishers == (service,):
            messages = record.of(topic, namespace)
            index = bisect_left(messages, before, key=_sent)
            if index:
                last = max(last, messages[index - 1].sent)
    return min(last + LATE, before)


def _ends(record: Record, namespace: str) -> dict[int, int]:
    """Return when processes ended, as far as the chaos monkey has seen it, by pid."""
    seen = record.events(PROCESSES, namespace)
    return {life.pid: _time(record, life.ended) for life in seen if life.ended is not None}


def _suspensions(record: Record, namespace: str) -> dict[int, list[Suspension]]:
    found: dict[int, list[Suspension]] = {}
    for fault in record.events(FAULTS, namespace):
        if fault.kind in SUSPENDING:
            begin, end = (_time(record, each) for each in (fault.begin, fault.end))
            suspension = Suspension(begin, end, fault.kind == "stop")
            found.setdefault(fault.pid, []).append(suspension)
    return found


def _time(record: Record, seconds: float) -> int:
    return record.origin + round(seconds * SECOND)


def _sent(message: Message) -> int:
    return message.sent
