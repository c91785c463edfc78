"""The health of the services as they report it on /diagnostics, 1 Hz each."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

from interfaces import topics


class Health(NamedTuple):
    """What a service said of itself last."""

    heard: float
    """when, on the monotonic clock [s]"""
    pid: int
    ok: bool
    reason: str
    """in words, where it is not"""
    since_output: float | None
    """[s] that its last output was old then; None before the first"""


class HealthMonitor:
    """Listens to /diagnostics: the latest health of each service in a node's namespace, by program."""

    def __init__(self, node: Node) -> None:
        self.latest: dict[str, Health] = {}
        self._namespace = node.get_namespace().rstrip("/")
        topic = topics.DIAGNOSTICS
        node.create_subscription(topic.type, topic.name, self._on_message, topic.qos)

    def _on_message(self, message: DiagnosticArray) -> None:
        self.latest.update(healths(message, self._namespace))


def healths(message: DiagnosticArray, prefix: str) -> dict[str, Health]:
    """The healths of services in a message, by program; what others say there is none."""
    found = {}
    for status in message.status:
        values = {pair.key: pair.value for pair in status.values}
        namespace, _, program = status.name.rpartition("/")
        if namespace == prefix and "published" in values:
            with suppress(KeyError, ValueError):  # of somebody who says something similar
                found[program] = _health(status, values)
    return found


def _health(status: DiagnosticStatus, values: dict[str, str]) -> Health:
    since_output = values["seconds_since_output"]
    return Health(
        heard=time.monotonic(),
        pid=int(values["pid"]),
        ok=status.level == DiagnosticStatus.OK,
        reason=status.message,
        since_output=float(since_output) if since_output else None,
    )
