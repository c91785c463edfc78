"""Reads and writes YAML by the rules of ROS 2's parameter files: those of libyaml and rcl_yaml_param_parser.

A scalar without quotes is typed as rcl types it: ``y`` is true, ``010`` is 8, ``1e5`` is a number, ``1:30``
and ``~`` are strings. ``!!str`` makes a string, other tags mean nothing. Keys are strings. What is written
has quotes where rcl or PyYAML would read something else. Aliases, deep nesting and large files are refused:
a small hostile file could fill the memory.
"""

from __future__ import annotations

import ctypes
import re
import reprlib
import sys
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path
from typing import Any, NoReturn

import yaml

MOST_OCTETS = 2**20
MOST_LEVELS = 32
_TRUE = ("Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON")
_FALSE = ("N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF")
_WORDS: dict[str, bool | float] = {
    **dict.fromkeys(_TRUE, True),
    **dict.fromkeys(_FALSE, False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
    **{f"{sign}.{inf}": float(f"{sign}inf") for sign in ("", "+", "-") for inf in ("inf", "Inf", "INF")},
}
_WORD = re.compile(r"[A-Za-z_/][A-Za-z0-9_./-]*")
_STRING = "tag:yaml.org,2002:str"
_EVENTS: type[Any] = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml, unless PyYAML was built without
_C = ctypes.CDLL(None, use_errno=True)
_C.strtoll.restype = ctypes.c_longlong
_C.strtod.restype = ctypes.c_double


class YamlError(ValueError):
    """Why a text cannot be read or a document cannot be written; one line, with the position in the text."""


class Plain(str):
    """A scalar without quotes, before :func:`typed` decides what it is."""


def read(path: str | Path) -> Any:
    """Return the content of a file. Raises OSError or YamlError."""
    with open(path, "rb") as file:  # which may be endless
        return load(file.read(MOST_OCTETS + 1))


def load(content: bytes | str) -> Any:
    """Return the content of one document; ``None`` if it is empty. Raises YamlError."""
    return typed(load_plain(content))


def load_plain(content: bytes | str) -> Any:
    """Return the content of one document, scalars without quotes as :class:`Plain`. Raises YamlError."""
    octets = content.encode(errors="surrogateescape") if isinstance(content, str) else content
    if len(octets) > MOST_OCTETS:
        raise YamlError(f"is larger than {MOST_OCTETS} octets")
    try:
        octets.decode()
        return _document(yaml.parse(octets, _EVENTS))
    except UnicodeDecodeError as error:
        raise YamlError(f"{_line(octets, error.start)}: octet {octets[error.start]:#x} is no UTF-8") from None
    except yaml.reader.ReaderError as error:
        raise YamlError(f"{_line(octets, error.position)}: {error.reason}") from None
    except yaml.MarkedYAMLError as error:
        reason = ", ".join(filter(None, (error.context, error.problem)))
        mark = error.problem_mark or error.context_mark
        raise YamlError(f"{_place(mark)}: {reason}" if mark else reason) from None


def typed(value: Any) -> Any:
    """Return a content with each :class:`Plain` as the boolean, integer, number or string that rcl reads."""
    if isinstance(value, dict):
        return {key: typed(each) for key, each in value.items()}
    if isinstance(value, list):
        return [typed(each) for each in value]
    if not isinstance(value, Plain):
        return value
    if value in _WORDS:
        return _WORDS[value]
    for convert, more in ((_C.strtoll, [0]), (_C.strtod, [])):
        rest = ctypes.c_char_p()
        ctypes.set_errno(0)
        number = convert(value.encode(), ctypes.byref(rest), *more)
        if not rest.value and not ctypes.get_errno():  # all of it is a number, in the range of its type
            return number
    return str(value)


def dump(document: Any, *, default_flow_style: bool | None = False) -> str:
    """Return a text that rcl and PyYAML read as this document.

    :raises YamlError: for what they cannot read: nothing, an integer beyond 64 bits, a NUL in a string.
    """
    text: str = yaml.dump(
        document, Dumper=_Dumper, sort_keys=False, default_flow_style=default_flow_style, width=sys.maxsize
    )
    return text


def _document(events: Iterator[yaml.Event]) -> Any:
    for event in events:
        if isinstance(event, yaml.DocumentStartEvent):
            break
    else:
        return None
    content = _node(next(events), events, 0)
    for event in events:
        if isinstance(event, yaml.DocumentStartEvent):
            raise _error(event, "a second document begins")
    return content


def _node(event: yaml.Event, events: Iterator[yaml.Event], level: int) -> Any:
    if isinstance(event, yaml.AliasEvent):
        raise _error(event, f"the alias {reprlib.repr(event.anchor)} is refused: write its content again")
    if isinstance(event, yaml.ScalarEvent):
        return _scalar(event)
    if level == MOST_LEVELS:
        raise _error(event, f"is nested more than {MOST_LEVELS} levels deep")
    if isinstance(event, yaml.SequenceStartEvent):
        items = []
        while not isinstance(event := next(events), yaml.SequenceEndEvent):
            items.append(_node(event, events, level + 1))
        return items
    mapping: dict[str, Any] = {}
    while not isinstance(event := next(events), yaml.MappingEndEvent):
        if not isinstance(event, yaml.ScalarEvent) or not event.value:
            raise _error(event, "a key must be a word")
        if (key := str(_scalar(event))) in mapping:
            raise _error(event, f"the key {reprlib.repr(key)} appears twice")
        mapping[key] = _node(next(events), events, level + 1)
    return mapping


def _scalar(event: yaml.ScalarEvent) -> str | None:
    if "\0" in event.value:
        raise _error(event, "a string must not contain a NUL")
    if event.style in ("'", '"') or event.tag == _STRING:
        return str(event.value)
    return Plain(event.value) if event.value else None


def _error(place: yaml.Event, reason: str) -> YamlError:
    return YamlError(f"{_place(place.start_mark)}: {reason}")


def _place(mark: Any) -> str:
    return f"line {mark.line + 1}, column {mark.column + 1}"


def _line(octets: bytes, position: int) -> str:
    return f"line {octets.count(10, 0, position) + 1}"


class _Dumper(yaml.SafeDumper):
    def ignore_aliases(self, data: Any) -> bool:
        return True

    def refuse(self, data: object) -> NoReturn:
        raise YamlError(f"{data!r} cannot be written: no parameter has such a value")

    def string(self, text: str) -> yaml.Node:
        if "\0" in text or any("\ud800" <= each <= "\udfff" for each in text):
            raise YamlError(f"{text!r} cannot be written: it is no text")
        is_word = _WORD.fullmatch(text) and isinstance(typed(Plain(text)), str)
        return self.represent_scalar(_STRING, text, style=None if is_word else '"')

    def integer(self, number: int) -> yaml.Node:
        if not -(2**63) <= number < 2**63:
            raise YamlError(f"{number} cannot be written: it has more than 64 bits")
        return self.represent_int(number)

    def real(self, number: float) -> yaml.Node:
        if 0.0 < abs(number) < sys.float_info.min:  # C reads only the exact value of such a number
            return self.represent_scalar("tag:yaml.org,2002:float", f"{Decimal(number):e}")
        return self.represent_float(number)


_Dumper.add_representer(type(None), _Dumper.refuse)
_Dumper.add_representer(str, _Dumper.string)
_Dumper.add_representer(int, _Dumper.integer)
_Dumper.add_representer(float, _Dumper.real)
