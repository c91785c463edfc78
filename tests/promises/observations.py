"""Reads the record of the observer: an MCAP with processes and faults as JSON in std_msgs/String."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from mcap_files import McapFile, UnreadableError
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from deploy.supervision.errors import DeploymentError
from deploy.supervision.recorder import METADATA
from interfaces import cause, topics
from interfaces.service.health import reported_movement, reported_parameters
from tests.promises import lateness
from tests.promises.history import (
    CONDITIONS,
    HOST,
    OVERLOAD,
    SAID,
    Condition,
    History,
    InjectedFault,
    Life,
    Sample,
)
from tests.promises.marks import is_babble

PROCESSES, FAULTS = "/chaos/processes", "/chaos/faults"  # topics
_TEXTS = ("namespace", "program", "words", "kind", "target", "detail")  # in an event; all else are numbers
EARLY = 0.001  # s by which a message may seem to be sent after its reception: clocks are read one by one


@contextmanager
def _opened(path: Path) -> Iterator[McapFile]:
    """Open a record. Raises DeploymentError if the file cannot be read, or is not a record."""
    try:
        with McapFile(path) as file:
            yield file
    except OSError as error:
        raise DeploymentError(f"Record {path}: {error.strerror}") from None
    except UnreadableError as error:
        raise DeploymentError(str(error)) from None
    except (LookupError, RecursionError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise DeploymentError(f"Record {path}: it is none of make chaos: {reason}") from None


def namespaces(path: Path) -> list[str]:
    """Return the namespaces of the arms in a record."""
    with _opened(path) as file:
        found = {_event(message.data)["namespace"] for _, message in file.messages([PROCESSES])}
    return sorted(found, key=lambda namespace: (len(namespace), namespace))


def remark(path: Path) -> str:
    """Return how much of a record without an end is judged; empty for a complete record."""
    with _opened(path) as file:
        return file.remark


def load(path: Path, namespace: str = "/") -> History:
    """Return the history of the arm in a namespace."""
    prefix = namespace.rstrip("/") + "/"
    names = {topic.full_name(namespace): topic for topic in topics.CONTRACT}
    streams: dict[str, list[Sample]] = {topic.name: [] for topic in topics.CONTRACT}
    lives: dict[tuple[int, float], Life] = {}
    faults: list[InjectedFault] = []
    conditions: list[Condition] = []
    with _opened(path) as file:
        (origin,) = (int(each.metadata["origin"]) for each in file.metadata if each.name == METADATA)
        end = (file.end - origin) / 1e9
        for channel, message in file.messages([*names, PROCESSES, FAULTS]):
            received, sent = ((t - origin) / 1e9 for t in (message.log_time, message.publish_time))
            if topic := names.get(channel.topic):
                streams[topic.name] += [
                    Sample(sent, received, value) for value in values(topic, message.data, prefix)
                ]
            elif channel.topic in (PROCESSES, FAULTS):
                event = read_event(channel.topic, message.data, namespace)
                if isinstance(event, InjectedFault):
                    faults.append(event)
                elif isinstance(event, Condition):
                    conditions.append(event)
                elif event is not None:
                    lives[event.pid, event.began] = event
    offsets = {0.0, *(fault.ahead for fault in faults)}
    for name, samples in streams.items():
        streams[name] = sorted(s._replace(sent=time_sent(s.received, s.sent, offsets)) for s in samples)
    history = History(
        end,
        streams,
        sorted(lives.values(), key=lambda life: life.began),
        sorted(faults, key=lambda f: f.begin),
        conditions,
    )
    overloads = [Condition(OVERLOAD, *each) for each in lateness.overloads(history)]
    return replace(history, conditions=sorted([*conditions, *overloads], key=lambda each: each.begin))


def clock_offsets(faults: Iterable[bytes]) -> set[float]:
    """Return by how much the arms' time of day was ahead of the machine's [s]; from :data:`FAULTS`."""
    return {0.0, *(_event(data).get("ahead", 0.0) for data in faults)}


def time_sent(received: float, stamp: float, offsets: Collection[float], second: int = 1) -> float:
    """Return when a message was sent, on the clock of its reception.

    :param stamp: its source time, on the arm's time of day.
    :param offsets: by which that has been ahead of the time of day of the receiver.
    :param second: in the unit of all these times.
    """
    if not any(offsets):
        return stamp
    # Among the possible latencies, the shortest that is not negative, up to the error of the clocks.
    latencies = (received - stamp + offset for offset in offsets)
    return received - min(latencies, key=lambda latency: (latency < -EARLY * second, abs(latency)))


def read_event(topic: str, data: bytes, namespace: str) -> Life | InjectedFault | Condition | None:
    """Return an event of :data:`PROCESSES` or :data:`FAULTS`; ``None`` if it concerns another arm."""
    event = _event(data)
    if event.pop("namespace", namespace) != namespace:
        return None
    event.pop("detail", None)  # of an older record; always empty
    if topic == PROCESSES:
        return Life(**event)
    if event["kind"] in CONDITIONS:  # records of before have them with the fields of a fault
        return Condition(event["kind"], event["begin"], event["end"])
    return InjectedFault(**event)


def _event(data: bytes) -> dict[str, Any]:
    event = json.loads(deserialize_message(data, String).data)
    if not isinstance(event, dict):
        raise ValueError("an event is no JSON object")
    for name, value in event.items():
        is_right = isinstance(value, str if name in _TEXTS else (float, int))
        if not is_right and (name, value) != ("ended", None):
            raise ValueError(f"{name} is {reprlib.repr(value)}")
    return event


def values(topic: topics.Topic, data: bytes, prefix: str) -> list[Any]:
    """Return the content of a message as plain values; none for an injected one."""
    if is_babble(topic, data):
        return []
    try:
        message = deserialize_message(data, topic.type)
    except Exception:  # of any type, by the runtime: the message is unreadable
        return []
    if topic is topics.EFFECTOR_POSITION:
        return [(message.point.x, message.point.y)]
    if topic is topics.OPERATOR_PRESENCE:
        return [message.stamp.sec + message.stamp.nanosec / 1e9]
    if topic is topics.DRIVEN_TIME:
        return [topic.value(message)[1:3]]
    if topic is topics.ENGINES_CAUSE:
        with suppress(ValueError):
            return [cause.read(message).words]
        return []
    if topic is not topics.DIAGNOSTICS:
        return [getattr(message, "data", None)]
    found = []
    for status in message.status:
        # The sentinel reports on other processes as `sentinel: NAME`; its report on itself counts as its own.
        reporter, _, subject = status.name.removeprefix(prefix).partition(": ")
        if status.name.startswith(prefix) and "/" not in reporter and subject in ("", reporter):
            with suppress(ValueError):  # a foreign node may use the key for something else
                given = reported_parameters(status) | reported_movement(status)
                if status.hardware_id:
                    given[HOST] = status.hardware_id
                if status.level != DiagnosticStatus.OK:
                    given[SAID] = status.message
                found += [
                    (reporter, int(pair.value), *given.items()) for pair in status.values if pair.key == "pid"
                ]
    return found
