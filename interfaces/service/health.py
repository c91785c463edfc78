"""The health of services: each service reports it on /diagnostics, at 1 Hz.

This module writes and reads the format of these reports.
"""

from __future__ import annotations

import json
import os
import re
import socket
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node

from interfaces.limits import MOST_KNOWN, PID, PUBLISHED, SINCE_OUTPUT, age, whole
from interfaces.plain_text import plain
from interfaces.service.beats import beat
from interfaces.service.enclave import Keys
from interfaces.service.reading import reading, unreported
from interfaces.topics import DIAGNOSTICS
from reactive_node import stamps

PERIOD = 1.0  # [s]
FASTEST = "fastest"
"""A fact of a joint that follows a drive: the speed that its scenario does not exceed [rad/s]."""
BY_HAND = "by hand"
"""A fact of a source whose value is set by hand: the name of the parameter."""
_PARAMETER = "parameter "  # before its name
_REFUSED = "refused "  # before the subject
_REASONS, _OTHER_REASONS = 4, "other reasons"  # in a report, for each subject
_LONGEST_REASON = 200  # characters: others choose their number and length, and a report must not be too large
_LONGEST_MESSAGE = 4000  # characters
_LONGEST_HOST = 64  # characters: HOST_NAME_MAX of Linux
_MOST_REFUSED = 50  # samples of a subject in a report
_NUMBER = re.compile(r"(?i)(?<![\w/.-])[-+]?(?:0x[\da-f]+|\d+(?:\.\d*)?(?:e[-+]?\d+)?|(?:nan|inf)\b)")
"""A number in a text, not one that is a part of a name such as `l1`, `/arm/2` or `host-2`."""


def cause(reason: str) -> str:
    """Return a reason without the numbers that were measured: it stays the same while they change."""
    return _NUMBER.sub("#", reason)


class _Remarks:
    """The reasons of a subject since the last report: of each cause the first text, and how often it came."""

    def __init__(self) -> None:
        self._texts: dict[str, str] = {}
        self._counts: Counter[str] = Counter()

    def add(self, reason: str) -> None:
        text = reason[:_LONGEST_REASON]
        # Of more than the text, which ends earlier where numbers are long.
        found = cause(reason[: 4 * _LONGEST_REASON])[:_LONGEST_REASON]
        if found not in self._texts and len(self._texts) >= _REASONS:
            found = text = _OTHER_REASONS
        self._texts.setdefault(found, text)
        self._counts[found] += 1

    def causes(self) -> set[str]:
        return set(self._texts)

    def counts(self) -> Mapping[str, int]:
        counts: Counter[str] = Counter()
        for found, text in self._texts.items():
            counts[text] += self._counts[found]
        return counts


class HealthReporter:
    """Reports the health of a node: every second, and at once to each new subscriber."""

    def __init__(self, node: Node, before_report: Callable[[], None] = lambda: None) -> None:
        """:param before_report: called every second before the report; it may add remarks."""
        self._node = node
        self._before_report = before_report
        self._started = time.monotonic()
        self._published = 0
        self.dropped = 0  # messages since the start
        self._last_output: float | None = None
        self.standing: Mapping[str, str] = {}
        """The warnings of each report until they are changed: the reason by subject."""
        self.facts: Mapping[str, str] = {}
        """Further facts of each report until they are changed, by name."""
        self.keys: Keys | None = None
        """Those with which the process has joined: each report warns of their end, if that is soon."""
        self._remarks: defaultdict[str, _Remarks] = defaultdict(_Remarks)  # since the last report
        self._of_last_second: Mapping[str, _Remarks] = {}  # which a new subscriber hears as well
        self._logged: set[tuple[str, str]] = set()  # the causes in the last report, by subject
        self._parameters: dict[str, str] = {}
        self._counts: Counter[str] = Counter()
        self._refused: dict[str, list[tuple[int, int | None]]] = {}  # since the last report, by subject
        self.publisher = node.create_publisher(
            DIAGNOSTICS.type,
            DIAGNOSTICS.name,
            DIAGNOSTICS.qos,
            # The launcher at its start and the sentinel after a restart need not wait for the next report.
            event_callbacks=PublisherEventCallbacks(matched=self.on_matched),
        )
        # On the steady clock: a paused simulation must not look like a hung service.
        node.create_timer(PERIOD, self.on_period, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def count_output(self) -> None:
        self._published += 1
        self._last_output = time.monotonic()

    def drop(self, subject: str, reason: str) -> None:
        """Count a dropped message and remark the reason."""
        self.dropped += 1
        self.remark(subject, reason)

    def remark(self, subject: str, reason: str) -> None:
        """Make the next report a warning with this reason."""
        self._remarks[subject].add(reason)

    def count(self, what: str) -> None:
        """Count something that is usual: each report has the number since the start."""
        self._counts[what] += 1

    def refuse(self, subject: str, reason: str, time: int, taken: int | None) -> None:
        """Count and remark a sample that a signal refused; the next report lists the first 50 for a replay.

        :param time, taken: that of the sample, and that from which it counts, if it was not dropped [ns].
        """
        refused = self._refused.setdefault(subject, [])
        if len(refused) < _MOST_REFUSED:
            refused.append((time, taken))
        if taken is None:
            self.drop(subject, reason)
        else:
            self.remark(subject, reason)

    def note_parameter(self, name: str, value: object) -> None:
        """Report the value of a parameter each time."""
        self._parameters[f"{_PARAMETER}{name}"] = json.dumps(value)

    def report(self) -> None:
        """Publish the health, with all remarks since the last report."""
        remarks, self._remarks = self._remarks, defaultdict(_Remarks)
        standing = dict(self.standing)
        if self.keys and (end := self.keys.warning(datetime.now(UTC))):
            standing["keys"] = end
        counts = {
            f"{subject}: {why}": n for subject, found in remarks.items() for why, n in found.counts().items()
        } | {f"{subject}: {why}": 1 for subject, why in standing.items()}
        causes = {(subject, each) for subject, found in remarks.items() for each in found.causes()}
        causes |= {(subject, cause(why)) for subject, why in standing.items()}
        if causes - self._logged:
            self._node.get_logger().warning(plain("; ".join(sorted(counts))))
        self._logged = causes
        warnings = [remark + (f" ({n} times)" if n > 1 else "") for remark, n in counts.items()]
        refused, self._refused = self._refused, {}
        now = time.monotonic()
        values = {
            PID: os.getpid(),
            "uptime": f"{now - self._started:.3f}",
            PUBLISHED: self._published,
            "dropped": self.dropped,
            SINCE_OUTPUT: "" if self._last_output is None else f"{now - self._last_output:.3f}",
            **self.facts,
            **self._counts,
            **{f"{_REFUSED}{subject}": json.dumps(samples) for subject, samples in refused.items()},
            **self._parameters,
        }
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if warnings else DiagnosticStatus.OK,
            name=self._node.get_fully_qualified_name(),
            message="; ".join(warnings)[:_LONGEST_MESSAGE] or "running",
            hardware_id=socket.gethostname(),
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = stamps.to_message(stamps.now())  # of day: supervision follows no simulation
        self.publisher.publish(message)

    def on_period(self) -> None:
        """Report; called each second."""
        beat()  # first: what follows may wait for DDS
        self._before_report()
        self._of_last_second = self._remarks
        self.report()

    def on_matched(self, subscribers: Any) -> None:
        """Report to a new subscriber at once; called when a subscriber comes or goes."""
        # Without what comes before a report: a new process has its first output to make.
        if subscribers.current_count_change > 0:
            self._remarks.update({**self._of_last_second, **self._remarks})
            with suppress(InvalidHandle):  # ROS 2's rclpy may call this after the node was destroyed
                self.report()


def reported_parameters(status: DiagnosticStatus) -> dict[str, Any]:
    """Return the parameters in a report: those whose value is not the default. Raises ValueError."""
    given = {
        pair.key.removeprefix(_PARAMETER): pair.value
        for pair in status.values
        if pair.key.startswith(_PARAMETER)
    }
    try:
        return {name: json.loads(value) for name, value in given.items()}
    except RecursionError as error:
        raise ValueError("a parameter is nested too deeply") from error


def reported_movement(status: DiagnosticStatus) -> dict[str, Any]:
    """Return :data:`FASTEST` and :data:`BY_HAND`, as far as a report has them. Raises ValueError."""
    read: dict[str, Callable[[str], Any]] = {FASTEST: float, BY_HAND: str}
    return {pair.key: read[pair.key](pair.value) for pair in status.values if pair.key in read}


def reported_refusals(status: DiagnosticStatus, subject: str) -> list[tuple[int, int | None]]:
    """Return the samples of a subject that signals refused, in a report. Raises ValueError.

    Of each: its time, and the time from which its value holds instead; ``None`` if it was dropped [ns].
    """
    return [
        (time, taken)
        for pair in status.values
        if pair.key == f"{_REFUSED}{subject}"
        for time, taken in json.loads(pair.value)
    ]


class Health(NamedTuple):
    heard: float
    """When it arrived, on the monotonic clock [s]."""
    pid: int
    ok: bool
    reason: str
    """Why the service is not ok."""
    since_output: float | None
    """Age of the service's last output [s]; ``None`` before the first."""
    host: str
    """The name of its host."""


@contextmanager
def listening(node: Node, hear: Callable[[DiagnosticArray], None]) -> Iterator[None]:
    """Call a function with each good message of /diagnostics."""
    good = reading(DIAGNOSTICS, unreported)["item"]

    def receive(data: bytes) -> None:
        if message := good(data):
            hear(message)

    subscription = node.create_subscription(
        DIAGNOSTICS.type, DIAGNOSTICS.name, receive, DIAGNOSTICS.qos, raw=True
    )
    try:
        yield
    finally:
        node.destroy_subscription(subscription)


@contextmanager
def heard_healths(node: Node) -> Iterator[dict[tuple[str, str], Health]]:
    """Listen to /diagnostics: the latest health of each service in the namespace of a node.

    It is kept by host and program: two hosts may run the same program, by mistake.
    """
    latest: dict[tuple[str, str], Health] = {}
    namespace = node.get_namespace().rstrip("/")

    def hear(message: DiagnosticArray) -> None:
        for program, health in healths(message, namespace).items():
            if (health.host, program) in latest or len(latest) < MOST_KNOWN:
                latest[health.host, program] = health

    with listening(node, hear):
        yield latest


def healths(message: DiagnosticArray, namespace: str) -> dict[str, Health]:
    """Return the reports of the services of a namespace in a message, by program; ignore other statuses."""
    found = {}
    for status in message.status:
        values = {pair.key: pair.value for pair in status.values}
        prefix, _, program = status.name.rpartition("/")
        if prefix == namespace and PUBLISHED in values:
            with suppress(KeyError, ValueError):  # not a report of ours
                found[program] = _health(status, values)
    return found


def _health(status: DiagnosticStatus, values: dict[str, str]) -> Health:
    return Health(
        heard=time.monotonic(),
        pid=whole(values[PID]),
        ok=status.level == DiagnosticStatus.OK,
        reason=status.message,
        since_output=age(values.get(SINCE_OUTPUT, "")),
        host=status.hardware_id[:_LONGEST_HOST],
    )
