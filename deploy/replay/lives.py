"""When the recorded processes lived, and when they were suspended."""

from __future__ import annotations

from bisect import bisect_left
from typing import NamedTuple

from rclpy.serialization import deserialize_message
from rclpy_simulation.host import SECOND

from deploy.chaos.record import FAULTS, PROCESSES
from deploy.replay.record import Message, Record, text
from interfaces.topics import (
    CONTRACT,
    DIAGNOSTICS,
    ENGINES_STATE,
    MISSED,
    OPERATOR_ACTIVITY,
    ROBOT_DESCRIPTION,
    Topic,
)
from services import engine_controller, operator_watchdog, robot_state

AHEAD = SECOND // 2
"""By which a process that is older than the record starts before it, to discover its inputs [ns]."""
LATE = SECOND // 20
"""By which a process outlives its last message, as timers of a replay may be late [ns]."""
SUSPENDING = ("stop", "slow")

_WATCHDOG = operator_watchdog.DEFAULTS
_TIMERS: dict[str, tuple[Topic, float, float]] = {
    "operator_watchdog": (
        OPERATOR_ACTIVITY,
        _WATCHDOG.sampling,
        operator_watchdog.FIRST_SAMPLE_AFTER_RESTART,
    ),
    "engine_controller": (ENGINES_STATE, engine_controller.DEFAULTS.repeat, 0.0),
    "robot_state": (ROBOT_DESCRIPTION, robot_state.DESCRIPTION_PERIOD, 0.0),
}
"""Topics that show when the timer of a service began, with its period and its first delay [s]."""


class Suspension(NamedTuple):
    """A fault in which a process lives, but does nothing. Times: ns since 1970."""

    kind: str
    begin: int
    end: int


class ReplayedLife(NamedTuple):
    """The life of a process of a service. Times: ns since 1970."""

    began: int
    """When it began its work."""
    ended: int | None
    """``None`` if it outlived the record."""
    suspensions: tuple[Suspension, ...] = ()


class _Seen(NamedTuple):
    """What the health reports of a process say."""

    created: int
    """When its node was created."""
    last: int
    """When it sent the last report."""


def lives(record: Record, namespace: str, service: str) -> list[ReplayedLife]:
    """
    Return the lives of a service's processes.

    Each health report tells the process and how long its node exists. A process that the chaos monkey saw
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
            found.append(ReplayedLife(began, ended, tuple(suspensions.get(pid, ()))))
    if found:
        return found
    return [ReplayedLife(_begin_of_work(record, namespace, service, record.begin - AHEAD), None)]


def _seen(record: Record, namespace: str, service: str) -> dict[int, _Seen]:
    """Return the processes of a service by pid."""
    found: dict[int, _Seen] = {}
    name = f"{namespace.rstrip('/')}/{service}"
    for sent, data in record.of(DIAGNOSTICS, namespace):
        if name.encode() not in data:
            continue
        try:
            for status in deserialize_message(data, DIAGNOSTICS.type).status:
                values = {pair.key: pair.value for pair in status.values}
                if status.name == name and "uptime" in values:
                    pid, created = int(values["pid"]), sent - round(float(values["uptime"]) * SECOND)
                    found[pid] = _Seen(found[pid].created if pid in found else created, sent)
        except Exception:  # of any type: the message is no report of ours
            continue
    return found


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


def origin(record: Record, namespace: str) -> int:
    """
    Return when the watchdog began to expect the operator, which a record does not contain [ns since 1970].

    Its first conclusion follows at the first sample or, without a sign of life, after the first silence.
    """
    first = next(iter(record.of(OPERATOR_ACTIVITY, namespace)), None)
    if first is None:
        return record.begin
    waited = _WATCHDOG.silence if text(first, OPERATOR_ACTIVITY) == MISSED else _WATCHDOG.sampling
    return first.sent - round(waited * SECOND)


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
            suspension = Suspension(fault.kind, _time(record, fault.begin), _time(record, fault.end))
            found.setdefault(fault.pid, []).append(suspension)
    return found


def _time(record: Record, seconds: float) -> int:
    """Return the time of an event of the chaos monkey."""
    return record.origin + round(seconds * SECOND)


def _sent(message: Message) -> int:
    return message.sent
