"""Writes log messages to the console, in rcutils' format, and to the `/rosout` publishers of the nodes.

Environment variables configure the console as in ROS 2: `RCUTILS_CONSOLE_OUTPUT_FORMAT`,
`RCUTILS_COLORIZED_OUTPUT`, `RCUTILS_LOGGING_USE_STDOUT` and `RCUTILS_LOGGING_BUFFERED_STREAM`. Source:
docs.ros.org, "About logging and logger configuration".
"""

from __future__ import annotations

import os
import re
import sys
import threading
import time
from collections.abc import Callable
from typing import NamedTuple, TextIO

from rclpy.impl.logging_severity import LoggingSeverity

_DEFAULT_FORMAT = "[{severity}] [{time}] [{name}]: {message}"
_ESCAPES = {r"\x1b": "\x1b", r"\a": "\a", r"\b": "\b", r"\n": "\n", r"\r": "\r", r"\t": "\t"}
_NAMES = {int(severity): severity.name for severity in LoggingSeverity}
_NO_COLOR = "\033[0m"
_COLORS = {0: _NO_COLOR, 10: "\033[32m", 20: _NO_COLOR, 30: "\033[33m", 40: "\033[31m", 50: "\033[31m"}


class LogRecord(NamedTuple):
    """A log message; `stamp` is system time [ns], `level` a `LoggingSeverity` value."""

    stamp: int
    level: int
    name: str
    message: str
    file: str
    function: str
    line: int


def _seconds(record: LogRecord) -> str:
    return f"{record.stamp // 1_000_000_000:010d}.{record.stamp % 1_000_000_000:09d}"


def _date(record: LogRecord) -> str:
    date = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(record.stamp // 1_000_000_000))
    return f"{date}.{record.stamp % 1_000_000_000 // 1_000_000:03d}"


_TOKENS: dict[str, Callable[[LogRecord], str]] = {
    "severity": lambda record: _NAMES[record.level],
    "name": lambda record: record.name,
    "message": lambda record: record.message,
    "function_name": lambda record: record.function,
    "file_name": lambda record: record.file,
    "time": _seconds,
    "date_time_with_ms": _date,
    "time_as_nanoseconds": lambda record: f"{record.stamp:019d}",
    "line_number": lambda record: str(record.line),
}


def _compile(output_format: str) -> list[str | Callable[[LogRecord], str]]:
    """Split a format into text and functions for its tokens; unknown tokens are text."""
    unescaped = re.sub(r"\\(?:x1b|[abnrt])", lambda escape: _ESCAPES[escape[0]], output_format)
    parts = re.split("(" + "|".join(f"{{{token}}}" for token in _TOKENS) + ")", unescaped)
    return [_TOKENS[part[1:-1]] if index % 2 else part for index, part in enumerate(parts)]


def _switch(variable: str) -> bool | None:
    """Read an environment variable that is 0, 1 or empty. Raises RuntimeError for another value."""
    value = os.environ.get(variable, "")
    if value not in ("", "0", "1"):
        raise RuntimeError(f"unexpected value [{value}] specified for {variable}. Valid values are 0 or 1.")
    return value == "1" if value else None


class _Console:
    def __init__(self) -> None:
        self.use_stdout = bool(_switch("RCUTILS_LOGGING_USE_STDOUT"))
        self.flush = _switch("RCUTILS_LOGGING_BUFFERED_STREAM") is not None
        self.colorized = _switch("RCUTILS_COLORIZED_OUTPUT")
        self.parts = _compile(os.environ.get("RCUTILS_CONSOLE_OUTPUT_FORMAT") or _DEFAULT_FORMAT)

    def write(self, record: LogRecord) -> None:
        stream = sys.stdout if self.use_stdout else sys.stderr
        if stream is None:
            return
        text = "".join([part if isinstance(part, str) else part(record) for part in self.parts])
        try:
            if self.colorized if self.colorized is not None else stream.isatty():
                text = f"{_COLORS[record.level]}{text}{_NO_COLOR}"
            _write_line(stream, text)
            if self.flush:
                stream.flush()
        except (OSError, ValueError):
            # A closed or full console is ignored, as by C's fprintf.
            return


def _write_line(stream: TextIO, text: str) -> None:
    try:
        stream.write(f"{text}\n")
    except UnicodeEncodeError:
        encoding = stream.encoding or "ascii"
        stream.write(text.encode(encoding, "backslashreplace").decode(encoding) + "\n")


_console: _Console | None = None
_console_enabled = True
# Logger name -> publishers of the nodes with that logger; the first one publishes.
_rosout: dict[str, list[Callable[[LogRecord], None]]] = {}
_rosout_lock = threading.RLock()
_publishing = threading.local()


def initialize() -> None:
    """Read the environment variables, once. Raises RuntimeError if one has an invalid value."""
    global _console
    if _console is None:
        _console = _Console()


def shutdown() -> None:
    """Reset the configuration; the next message reads the environment variables again."""
    global _console
    _console = None


def enable_console(enabled: bool) -> None:
    global _console_enabled
    _console_enabled = enabled


def add_rosout_publisher(logger_name: str, publish: Callable[[LogRecord], None]) -> None:
    """Publish the messages of a logger and its future children with `publish`, on the thread that logs."""
    with _rosout_lock:
        _rosout.setdefault(logger_name, []).append(publish)


def remove_rosout_publisher(publish: Callable[[LogRecord], None]) -> None:
    """Remove a publisher from the logger and its children."""
    with _rosout_lock:
        for name, publishers in list(_rosout.items()):
            kept = [other for other in publishers if other != publish]
            if kept:
                _rosout[name] = kept
            else:  # the garbage collector may just have removed a child
                _rosout.pop(name, None)


def share_rosout_publisher(parent: str, child: str) -> Callable[[LogRecord], None] | None:
    """Make the logger `child` publish as `parent` does; return the publisher, `None` without one."""
    with _rosout_lock:
        publishers = _rosout.get(parent)
        if not publishers:
            return None
        add_rosout_publisher(child, publishers[0])
        return publishers[0]


def unshare_rosout_publisher(child: str, publish: Callable[[LogRecord], None]) -> None:
    with _rosout_lock:
        publishers = _rosout.get(child, [])
        if publish in publishers:
            publishers.remove(publish)
        if not publishers:
            _rosout.pop(child, None)


def output(record: LogRecord) -> None:
    """Write a message to the console and publish it."""
    if _console_enabled:
        _ready_console().write(record)
    publishers = _rosout.get(record.name)
    # Publishing may log. Such messages go to the console only, to avoid an endless recursion.
    if publishers and not getattr(_publishing, "active", False):
        _publishing.active = True
        try:
            publishers[0](record)
        except Exception as error:
            print(f"Failed to publish log message to rosout: {error}", file=sys.stderr)
        finally:
            _publishing.active = False


def _ready_console() -> _Console:
    global _console
    if _console is None:
        try:
            _console = _Console()
        except RuntimeError as error:
            print(f"[rclpy] error initializing logging: {error}", file=sys.stderr)
            _console = _Console.__new__(_Console)
            _console.use_stdout, _console.flush, _console.colorized = False, False, None
            _console.parts = _compile(_DEFAULT_FORMAT)
    return _console
