"""Health reports of other hosts, as a listener hears them."""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta
from typing import Protocol, TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from reactive_node import stamps


class Listener(Protocol):
    def hear(self, message: DiagnosticArray) -> None: ...


L = TypeVar("L", bound=Listener)


def report(program: str, host: str, *, pid: int = 7, age: float = 0.002) -> DiagnosticArray:
    """Return a report of a program that was sent ``age`` seconds ago."""
    values = [KeyValue(key="pid", value=str(pid)), KeyValue(key="published", value="1")]
    message = DiagnosticArray(status=[DiagnosticStatus(name=program, hardware_id=host, values=values)])
    message.header.stamp = stamps.to_message(stamps.now() - timedelta(seconds=age))
    return message


def heard(listener: Callable[[str], L], *reports: DiagnosticArray, namespace: str = "/") -> L:
    """Return a listener of the arm in a namespace that has heard some reports."""
    made = listener(namespace)
    for each in reports:
        made.hear(each)
    return made
