"""The limits of what others may send: sizes of messages, and numbers in the texts of reports."""

from __future__ import annotations

from typing import TypeVar

from diagnostic_msgs.msg import DiagnosticArray

K = TypeVar("K")
V = TypeVar("V")

LARGEST = 1e9  # of all numbers: no square overflows, and a timer waits for no time after the year 9999
LARGEST_MESSAGE = 32_768
"""Octets of a message. To deserialize it may take 250 times as much memory and 0.2 µs of each octet: rclpy
believes that an element of a sequence takes one octet."""
MOST_KNOWN = 500  # services that a reader remembers by host and name: others choose how many there are
PID, PUBLISHED = "pid", "published"
SINCE_OUTPUT = "seconds_since_output"
PROCESS, RESTARTS, UPTIME, AWAY = "process", "restarts", "uptime", "away"
_SHOWN = 40  # characters of a text that is refused


def newest(known: dict[K, V]) -> dict[K, V]:
    """Return what was added last to a dictionary, if others have added more than ``MOST_KNOWN`` items."""
    return dict([*known.items()][-MOST_KNOWN:]) if len(known) > MOST_KNOWN else known


def whole(text: str) -> int:
    """Return the whole number in a text of at most nine digits of ASCII. Raises ValueError."""
    if text.isascii() and text.isdecimal() and len(text) <= 9:
        return int(text)
    raise ValueError(f"{text[:_SHOWN]!r} is no whole number")


def number(text: str) -> float:
    """Return the number in a text, from -1e9 to 1e9. Raises ValueError."""
    found = float(text)
    if not abs(found) <= LARGEST:  # this refuses NaN
        raise ValueError(f"{text[:_SHOWN]!r} is out of range")
    return found


def seconds(text: str) -> float:
    """Return a time [s] from 0 to 1e9. Raises ValueError."""
    if (found := number(text)) < 0.0:
        raise ValueError(f"{text[:_SHOWN]!r} is negative")
    return found


def age(text: str) -> float | None:
    """Return an age [s]; ``None`` for an empty text. Raises ValueError."""
    return seconds(text) if text else None


_NUMBERS = {
    PID: whole,
    RESTARTS: whole,
    UPTIME: seconds,
    AWAY: seconds,
    SINCE_OUTPUT: age,
}


def bad_report(message: DiagnosticArray) -> str:
    """Return which number of a service's or sentinel's report is none; empty if all are.

    Other programs may publish on /diagnostics: what they report is not judged.
    """
    for status in message.status:
        values = {pair.key: pair.value for pair in status.values}
        if PUBLISHED not in values and PROCESS not in values:
            continue
        for key, read in _NUMBERS.items():
            try:
                read(values.get(key, "0"))
            except ValueError:
                return f"{status.name[:_SHOWN]!r} reports {key} {values[key][:_SHOWN]!r}"
    return ""
