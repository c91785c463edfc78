"""Messages of any content: the whole range of a type, and reports on /diagnostics that nearly are ours."""

from __future__ import annotations

import importlib
import re
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=40)
ODD_NUMBERS = (
    *("0", "7", "-1", "1.5", "", " 5 ", "1_000", "0x10", "1e9", "1e400", "NaN", "inf", "-inf", "٣", "²"),
    *(str(2**31), str(2**70), "-" + "9" * 4300, "9" * 4300, "9" * 4301, "1" + "0" * 400),
)
NUMBERS = st.sampled_from(ODD_NUMBERS)
_LEAST, _MOST = {"int": -1, "uint": 0}, {"int": 1, "uint": 2}
_SEQUENCE = re.compile(r"sequence<(.+?)(?:, (\d+))?>|(.+)\[(\d+)\]")


def messages(type_: Any) -> st.SearchStrategy[Any]:
    """Return messages of a type, of all values that their fields can have."""
    fields = type_.get_fields_and_field_types().items()
    return st.builds(type_, **{name: _values(kind) for name, kind in fields})


def _values(kind: str) -> st.SearchStrategy[Any]:
    if found := _SEQUENCE.fullmatch(kind):
        several, most, one, count = found.groups()
        least = int(count or 0)
        return st.lists(_values(several or one), min_size=least, max_size=int(count or most or 3))
    if "/" in kind:
        package, name = kind.split("/")
        return messages(getattr(importlib.import_module(f"{package}.msg"), name))
    if number := re.fullmatch(r"(u?int)(\d+)", kind):
        half = 2 ** (int(number[2]) - 1)
        return st.integers(_LEAST[number[1]] * half, _MOST[number[1]] * half - 1)
    if kind in ("byte", "octet"):
        return st.binary(min_size=1, max_size=1)
    if kind in ("double", "float"):
        return st.floats(width=64 if kind == "double" else 32)
    if kind == "boolean":
        return st.booleans()
    assert kind.startswith("string"), kind
    return TEXTS


KEYS = (
    *("pid", "published", "seconds_since_output", "clock of host robot"),
    *("process", "state", "restarts", "uptime", "away", "last exit"),
    *("parameter silence", "parameter presence_timeout"),
)


def reports(*nodes: str) -> st.SearchStrategy[DiagnosticArray]:
    """Return messages of /diagnostics: reports of services and the sentinel in which some values are odd.

    :param nodes: the full names of the services.
    """

    def status(name: str, subject: str, odd: list[KeyValue], **fields: Any) -> DiagnosticStatus:
        values = dict.fromkeys(KEYS, "1") | {"process": subject}
        good = [KeyValue(key=key, value=value) for key, value in values.items()]
        whose = f"{name}: {subject}" if subject else name
        return DiagnosticStatus(name=whose, values=[*good, *odd], **fields)

    programs = [node.rpartition("/")[2] for node in nodes]
    odd = st.builds(KeyValue, key=st.sampled_from(KEYS) | TEXTS, value=NUMBERS | TEXTS)
    statuses = st.builds(
        status,
        st.sampled_from(nodes) | TEXTS,
        st.sampled_from(["", *programs]) | TEXTS,
        st.lists(odd, max_size=2),
        level=st.binary(min_size=1, max_size=1),
        message=TEXTS,
        hardware_id=st.just("robot") | TEXTS,
    )
    return st.builds(DiagnosticArray, header=messages(Header), status=st.lists(statuses, max_size=3))


def octets(type_: Any) -> st.SearchStrategy[bytes]:
    """Return what a stranger may send as a message of a type: messages, parts of them, and noise."""
    whole = messages(type_).map(serialize_message)
    parts = st.builds(lambda data, length: data[:length], whole, st.integers(0, 100))
    changed = st.builds(
        lambda data, at, other: data[: at % len(data)] + other + data[at % len(data) + len(other) :],
        whole,
        st.integers(0, 10_000),
        st.binary(min_size=1, max_size=4) | st.just(b"\xff\xff\xff\xff"),
    )
    return whole | parts | changed | st.binary(max_size=100) | st.binary(max_size=40).map(b"\0\1\0\0".__add__)
