"""The health of services: each service reports it on /diagnostics, at 1 Hz.

This module writes and reads the format of these reports.
"""

from __future__ import annotations

import json
import os
import socket
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node

from interfaces.limits import LARGEST
from interfaces.service.beats import beat
from interfaces.service.enclave import Keys
from interfaces.topics import DIAGNOSTICS

PERIOD = 1.0  # [s]
_PID, _PUBLISHED, _SINCE_OUTPUT = "pid", "published", "seconds_since_output"
_SINCE_TURN_OFF = "seconds_since_turn_off"
_PARAMETER = "parameter "  # before its name
_REFUSED = "refused "  # before the subject
_REASONS, _OTHER_REASONS = 4, "other reasons"  # in a report, for each subject


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
        self._last_turn_off: float | None = None
        self.standing: Mapping[str, str] = {}
        """What each report warns of until it is changed: the reason by subject."""
        self.facts: Mapping[str, str] = {}
        """What each report tells besides until it is changed, by name."""
        self.keys: Keys | None = None
        """Those with which the process has joined: each report warns of their end, if that is soon."""
        self._remarks: dict[str, Counter[str]] = {}  # since the last report: subject, reason, how often
        self._logged: set[str] = set()  # the remarks of the last report
        self._parameters: dict[str, str] = {}
        self._counts: Counter[str] = Counter()
        self._refused: dict[str, list[tuple[int, int | None]]] = {}  # since the last report, by subject
        self._publisher = node.create_publisher(
            DIAGNOSTICS.type,
            DIAGNOSTICS.name,
            DIAGNOSTICS.qos,
            # The launcher at its start and the sentinel after a restart need not wait for the next report.
            event_callbacks=PublisherEventCallbacks(matched=self._on_matched),
        )
        # On the steady clock: a paused simulation must not look like a hung service.
        node.create_timer(PERIOD, self._on_period, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def count_output(self) -> None:
        self._published += 1
        self._last_output = time.monotonic()

    def note_turn_off(self) -> None:
        """Tell in each report when the last ``turn_off`` was sent: a message does not name its sender."""
        self._last_turn_off = time.monotonic()

    def drop(self, subject: str, reason: str) -> None:
        """Count a dropped message and remark the reason."""
        self.dropped += 1
        self.remark(subject, reason)

    def remark(self, subject: str, reason: str) -> None:
        """Make the next report a warning with this reason."""
        reasons = self._remarks.setdefault(subject, Counter())
        reasons[reason if reason in reasons or len(reasons) < _REASONS else _OTHER_REASONS] += 1

    def count(self, what: str) -> None:
        """Count something that is usual: each report tells the number since the start."""
        self._counts[what] += 1

    def refuse(self, subject: str, reason: str, time: int, taken: int | None) -> None:
        """Count and remark a sample that a signal refused; the next report tells a replay of it.

        :param time, taken: that of the sample, and that from which it counts, if it was not dropped [ns].
        """
        self._refused.setdefault(subject, []).append((time, taken))
        if taken is None:
            self.drop(subject, reason)
        else:
            self.remark(subject, reason)

    def note_parameter(self, name: str, value: object) -> None:
        """Tell in each report that a parameter has another value than its default."""
        self._parameters[f"{_PARAMETER}{name}"] = json.dumps(value)

    def report(self) -> None:
        """Publish the health, with all remarks since the last report."""
        remarks, self._remarks = self._remarks, {}
        standing = dict(self.standing)
        if self.keys and (end := self.keys.warning(datetime.now(UTC))):
            standing["keys"] = end
        counts = {
            f"{subject}: {why}": n for subject, reasons in remarks.items() for why, n in reasons.items()
        } | {f"{subject}: {why}": 1 for subject, why in standing.items()}
        if counts.keys() - self._logged:
            self._node.get_logger().warning("; ".join(sorted(counts)))
        self._logged = set(counts)
        warnings = [remark + (f" ({n} times)" if n > 1 else "") for remark, n in counts.items()]
        refused, self._refused = self._refused, {}
        now = time.monotonic()
        values = {
            _PID: os.getpid(),
            "uptime": f"{now - self._started:.3f}",
            _PUBLISHED: self._published,
            "dropped": self.dropped,
            _SINCE_OUTPUT: "" if self._last_output is None else f"{now - self._last_output:.3f}",
            **({} if self._last_turn_off is None else {_SINCE_TURN_OFF: f"{now - self._last_turn_off:.3f}"}),
            **self.facts,
            **self._counts,
            **{f"{_REFUSED}{subject}": json.dumps(samples) for subject, samples in refused.items()},
            **self._parameters,
        }
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if warnings else DiagnosticStatus.OK,
            name=self._node.get_fully_qualified_name(),
            message="; ".join(warnings) or "running",
            hardware_id=socket.gethostname(),
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _on_period(self) -> None:
        beat()  # first: what follows may wait for DDS
        self._before_report()
        self.report()

    def _on_matched(self, subscribers: Any) -> None:
        # Without what comes before a report: a new process has its first output to make.
        if subscribers.current_count_change > 0:
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
    since_turn_off: float | None = None
    """Age of its last ``turn_off`` [s]; ``None`` before the first."""
    host: str = ""
    """The name of its host."""


@contextmanager
def listening(node: Node, hear: Callable[[DiagnosticArray], None]) -> Iterator[None]:
    """Call a function with each message of /diagnostics."""
    subscription = node.create_subscription(DIAGNOSTICS.type, DIAGNOSTICS.name, hear, DIAGNOSTICS.qos)
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
            latest[health.host, program] = health

    with listening(node, hear):
        yield latest


def healths(message: DiagnosticArray, namespace: str) -> dict[str, Health]:
    """Return the reports of the services of a namespace in a message, by program; ignore other statuses."""
    found = {}
    for status in message.status:
        values = {pair.key: pair.value for pair in status.values}
        prefix, _, program = status.name.rpartition("/")
        if prefix == namespace and _PUBLISHED in values:
            with suppress(KeyError, ValueError):  # not a report of ours
                found[program] = _health(status, values)
    return found


def _health(status: DiagnosticStatus, values: dict[str, str]) -> Health:
    return Health(
        heard=time.monotonic(),
        pid=int(values[_PID]),
        ok=status.level == DiagnosticStatus.OK,
        reason=status.message,
        since_output=_age(values.get(_SINCE_OUTPUT)),
        since_turn_off=_age(values.get(_SINCE_TURN_OFF)),
        host=status.hardware_id,
    )


def _age(value: str | None) -> float | None:
    return seconds(value) if value else None


def seconds(value: str) -> float:
    """Return a time in a report [s]. Raises ValueError for one from which no date can be computed."""
    found = float(value)
    if not 0.0 <= found <= LARGEST:  # this refuses NaN
        raise ValueError(f"{value} is no time")
    return found
