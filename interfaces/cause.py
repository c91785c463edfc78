"""Why the engines are on or off, as the engine controller says it on ``engines/cause``.

It is a DiagnosticArray with one status, whose message says it in words.
"""

from __future__ import annotations

import socket
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from interfaces.limits import LARGEST, seconds
from reactive_node import stamps

STARTED, UNSEEN, PAUSED = "started", "unseen", "paused"
NAMELESS = "a node that gave no name"
_REASONS = {"operator_watchdog": " (operator incapacitated)"}
"""The only reason for which a node sends ``turn_off``."""
_LONGEST = 300  # characters of a text


class Cause(NamedTuple):
    state: str
    """``on`` or ``off``."""
    event: str
    """The event: ``turn_on`` or ``turn_off``, or in the controller itself STARTED, UNSEEN or PAUSED."""
    sender: str = ""
    """The sender of the command; empty if it gave no name."""
    age: float = 0.0
    """Of the command, of the last sign of the operator (UNSEEN), or of the pause, when it decided [s]."""
    since: float = 0.0
    """For how long the state has lasted when this was sent [s]."""
    refused: str = ""
    """Why the last ``turn_on`` was refused since then; empty if none was."""

    @property
    def words(self) -> str:
        by = self.sender or NAMELESS
        match self.event:
            case "turn_on":
                return f"turned on by {by}"
            case "turn_off":
                return f"turned off by {by}{_REASONS.get(by, '')}"
            case event if event == UNSEEN:
                return f"turned off by engine_controller (no operator seen for {self.age:.1f} s)"
            case event if event == PAUSED:
                return f"turned off by engine_controller (it stood still for {self.age:.1f} s)"
        return "not turned on since engine_controller started"


def message(cause: Cause) -> DiagnosticArray:
    values = {
        "state": cause.state,
        "event": cause.event,
        "sender": cause.sender,
        "age": f"{min(max(cause.age, 0.0), LARGEST):.3f}",
        "since": f"{min(max(cause.since, 0.0), LARGEST):.3f}",
        "refused": cause.refused,
    }
    status = DiagnosticStatus(
        level=DiagnosticStatus.OK,
        name="engines",
        message=cause.words,
        hardware_id=socket.gethostname(),
        values=[KeyValue(key=key, value=value[:_LONGEST]) for key, value in values.items()],
    )
    array = DiagnosticArray(status=[status])
    array.header.stamp = stamps.to_message(stamps.now())
    return array


def read(array: DiagnosticArray) -> Cause:
    """Return the cause in a message. Raises ValueError if there is none."""
    if len(array.status) != 1:
        raise ValueError("it has not one status")
    values = {pair.key: pair.value for pair in array.status[0].values}
    missing = [key for key in Cause._fields if key not in values]
    if missing or any(len(values[key]) > _LONGEST for key in Cause._fields):
        raise ValueError(f"it lacks {missing[0]}" if missing else "a text is too long")
    if values["state"] not in ("on", "off"):
        raise ValueError(f"{values['state'][:40]!r} is unknown")
    age, since = seconds(values.pop("age")), seconds(values.pop("since"))
    texts = {key: values[key] for key in Cause._fields if key in values}
    return Cause(**texts, age=age, since=since)


def problem(array: DiagnosticArray) -> str:
    """Return what is wrong with a message; empty for a good one."""
    try:
        read(array)
    except ValueError as error:
        return str(error)
    return ""
