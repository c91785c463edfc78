"""Reads the record of the observer: an MCAP with processes and faults as JSON in std_msgs/String."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcap_files import McapFile, UnreadableError
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from deploy.supervision.errors import DeploymentError
from deploy.supervision.recorder import METADATA
from interfaces import topics
from interfaces.service.health import reported_parameters
from tests.promises.effects import Effect, Why, effects, undisturbed
from tests.promises.history import (
    ALL,
    NO_TARGET,
    OVERLOAD,
    History,
    InjectedFault,
    Life,
    Sample,
    merged,
)
from tests.promises.marks import is_babble

PROCESSES, FAULTS = "/chaos/processes", "/chaos/faults"  # topics
LATE = 0.1  # s; a message that takes longer shows an overload
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
    with _opened(path) as file:
        origin = next(int(each.metadata["origin"]) for each in file.metadata if each.name == METADATA)
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
    )
    overloads = [InjectedFault(OVERLOAD, NO_TARGET, *each) for each in late_receptions(history)]
    return replace(history, faults=sorted([*history.faults, *overloads], key=lambda f: f.begin))


def late_receptions(history: History) -> list[tuple[float, float]]:
    """Return the times in which a message waited for the observer, or for its sender: an overload.

    Messages that a fault of the network may have delayed do not count, nor those of a publisher that the
    observer may not have discovered yet.
    """
    found = [each for each in effects(history) if each.why in (Why.LATE_LINE, Why.LATE_START)]
    return merged(
        (sample.sent, sample.received)
        for topic in topics.CONTRACT
        for sample in history.stream(topic)
        if sample.received - sample.sent > LATE and _shows_overload(found, topic, sample)
    )


def _shows_overload(found: Iterable[Effect], topic: topics.Topic, sample: Sample) -> bool:
    """Return whether nothing else explains that a message was late."""
    publishers = topic.publishers if topic is not topics.DIAGNOSTICS else sample.value[:1]
    return undisturbed(found, ALL, sample.sent, sample.received, Why.LATE_LINE) and all(
        undisturbed(found, each, sample.sent, sample.sent, Why.LATE_START) for each in publishers
    )


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


def read_event(topic: str, data: bytes, namespace: str) -> Life | InjectedFault | None:
    """Return an event of :data:`PROCESSES` or :data:`FAULTS`; ``None`` if it concerns another arm."""
    event = _event(data)
    if event.pop("namespace", namespace) != namespace:
        return None
    event.pop("detail", None)  # of an older record; always empty
    return InjectedFault(**event) if topic == FAULTS else Life(**event)


def _event(data: bytes) -> dict[str, Any]:
    event: dict[str, Any] = json.loads(deserialize_message(data, String).data)
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
    if topic is not topics.DIAGNOSTICS:
        return [getattr(message, "data", None)]
    found = []
    for status in message.status:
        # The sentinel reports on other processes as `sentinel: NAME`; its report on itself counts as its own.
        reporter, _, subject = status.name.removeprefix(prefix).partition(": ")
        if status.name.startswith(prefix) and "/" not in reporter and subject in ("", reporter):
            with suppress(ValueError):  # a foreign node may use the key for something else
                given = reported_parameters(status).items()
                found += [(reporter, int(pair.value), *given) for pair in status.values if pair.key == "pid"]
    return found
