"""Parses ``.msg``, ``.srv`` and ``.action`` files into fields, constants and default values.

Source of the format: the ROS 2 interface definition language (docs.ros.org, "Interfaces"), as Jazzy's
``rosidl_adapter`` reads it. Parsed types have their IDL names (``double``, ``octet``, ``sequence<string>``),
as in ``get_fields_and_field_types()``.
"""

from __future__ import annotations

import re
from keyword import iskeyword
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable

Literal = bool | int | float | str
"""A value in a definition file."""

_IDL_NAMES = {
    "bool": "boolean",
    "byte": "octet",
    "char": "uint8",
    "float32": "float",
    "float64": "double",
    **{f"{sign}int{bits}": f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)},
    "string": "string",
    "wstring": "wstring",
}

_TYPE = re.compile(
    r"(?P<base>[A-Za-z][\w/]*)(?:<=(?P<bound>\d+))?(?P<array>\[(?P<upper><=)?(?P<size>\d*)\])?"
)
_NAME = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
_CONSTANT_NAME = re.compile(r"[A-Z][A-Z0-9]*(?:_[A-Z0-9]+)*")
_TYPE_NAME = re.compile(r"[A-Z][A-Za-z0-9]*")
_QUOTED = re.compile(r"""'(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*\"""")
# the escapes of Python, valid or not; other backslashes stay
_ESCAPE = re.compile(r"""\\(?:[\\'"abfnrtv]|[0-7]{1,3}|x.{0,2}|u.{0,4}|U.{0,8}|N(?:\{[^}]*\})?|$)""")
_IDL_ESCAPE = re.compile(r"""\\(?:[\\'"abfnrtv]|[0-7]{1,3}|x[0-9a-fA-F]{1,2})""")
_IDL_STRING = re.compile(r"""(?:[^\\]|\\[^"])*""")


class InvalidDefinition(ImportError):
    """An invalid definition file. The text is a single line: file, line and reason."""


class FieldType(NamedTuple):
    """The type of a field: a base type, or an array or sequence of it."""

    base: str
    """IDL name of a primitive, or the full name of a message (``std_msgs/msg/Header``)."""
    string_bound: int = 0
    """Maximum number of characters of a string; 0 is unbounded."""
    array_size: int = 0
    """Number of elements of an array; 0 for other types."""
    is_sequence: bool = False
    sequence_bound: int = 0
    """Maximum number of elements of a sequence; 0 is unbounded."""

    @property
    def is_message(self) -> bool:
        return "/" in self.base

    @property
    def is_plural(self) -> bool:
        return self.is_sequence or self.array_size > 0

    def __str__(self) -> str:
        """Name of the type as in ``get_fields_and_field_types()``."""
        name = self.base
        if self.is_message:
            package, _, name = name.split("/")
            name = f"{package}/{name}"
        elif self.string_bound:
            name = f"{name}<{self.string_bound}>"
        if self.array_size:
            return f"{name}[{self.array_size}]"
        if self.sequence_bound:
            return f"sequence<{name}, {self.sequence_bound}>"
        return f"sequence<{name}>" if self.is_sequence else name


class Field(NamedTuple):
    name: str
    type: FieldType
    default: Literal | tuple[Literal, ...] | None = None
    """The default value in the definition, or None."""


class Constant(NamedTuple):
    name: str
    type: str
    value: Literal


class MessageDefinition(NamedTuple):
    name: str
    """Full name, for example ``std_msgs/msg/Header``."""
    fields: tuple[Field, ...]
    constants: tuple[Constant, ...] = ()

    @property
    def members(self) -> tuple[Field, ...]:
        """The fields in IDL, CDR and type hashes, where a struct cannot be empty."""
        return self.fields or (Field("structure_needs_at_least_one_member", FieldType("uint8")),)


class ServiceDefinition(NamedTuple):
    name: str
    """Full name, for example ``std_srvs/srv/Trigger``."""
    request: MessageDefinition
    response: MessageDefinition

    @property
    def event(self) -> MessageDefinition:
        """The message that service introspection publishes for each step of a call."""
        return MessageDefinition(
            f"{self.name}_Event",
            (
                Field("info", FieldType("service_msgs/msg/ServiceEventInfo")),
                Field("request", FieldType(self.request.name, is_sequence=True, sequence_bound=1)),
                Field("response", FieldType(self.response.name, is_sequence=True, sequence_bound=1)),
            ),
        )


class ActionDefinition(NamedTuple):
    """An action type, and the services and the message that transport it."""

    name: str
    """Full name, for example ``example_interfaces/action/Fibonacci``."""
    goal: MessageDefinition
    result: MessageDefinition
    feedback: MessageDefinition

    @property
    def send_goal(self) -> ServiceDefinition:
        """The service that sends a goal with its UUID."""
        return self._service(
            "SendGoal",
            (_GOAL_ID, Field("goal", FieldType(self.goal.name))),
            (
                Field("accepted", FieldType("boolean")),
                Field("stamp", FieldType("builtin_interfaces/msg/Time")),
            ),
        )

    @property
    def get_result(self) -> ServiceDefinition:
        """The service that waits for the result of a goal."""
        result = Field("result", FieldType(self.result.name))
        return self._service("GetResult", (_GOAL_ID,), (Field("status", FieldType("int8")), result))

    @property
    def feedback_message(self) -> MessageDefinition:
        feedback = Field("feedback", FieldType(self.feedback.name))
        return MessageDefinition(f"{self.name}_FeedbackMessage", (_GOAL_ID, feedback))

    def _service(
        self, suffix: str, request: tuple[Field, ...], response: tuple[Field, ...]
    ) -> ServiceDefinition:
        name = f"{self.name}_{suffix}"
        return ServiceDefinition(
            name,
            MessageDefinition(f"{name}_Request", request),
            MessageDefinition(f"{name}_Response", response),
        )


_GOAL_ID = Field("goal_id", FieldType("unique_identifier_msgs/msg/UUID"))


def parse_message(name: str, text: str, source: str, is_defined: Callable[[str], bool]) -> MessageDefinition:
    """Read a ``.msg`` file. Raises InvalidDefinition.

    ``source`` is the file's name in errors. ``is_defined`` tells by its full name whether a message exists.
    """
    return _parse(name, text.splitlines(), source, 1, is_defined)


def parse_service(name: str, text: str, source: str, is_defined: Callable[[str], bool]) -> ServiceDefinition:
    """Read a ``.srv`` file, with the arguments and errors of parse_message."""
    parts = ("Request", "Response")
    return ServiceDefinition(name, *_parse_parts(name, parts, "a service", text, source, is_defined))


def parse_action(name: str, text: str, source: str, is_defined: Callable[[str], bool]) -> ActionDefinition:
    """Read an ``.action`` file, with the arguments and errors of parse_message."""
    parts = ("Goal", "Result", "Feedback")
    return ActionDefinition(name, *_parse_parts(name, parts, "an action", text, source, is_defined))


def _parse_parts(
    name: str,
    parts: tuple[str, ...],
    kind: str,
    text: str,
    source: str,
    is_defined: Callable[[str], bool],
) -> list[MessageDefinition]:
    """Read the messages ``<name>_<part>`` of a file, which lines ``---`` separate."""
    lines = text.splitlines()
    separators = [number for number, line in enumerate(lines) if line.strip() == "---"]
    wanted = len(parts) - 1
    if len(separators) != wanted:
        line = separators[wanted] + 1 if len(separators) > wanted else max(len(lines), 1)
        expected = "one line '---'" if wanted == 1 else f"{wanted} lines '---'"
        raise InvalidDefinition(f"{source}:{line}: {kind} needs exactly {expected}, not {len(separators)}")
    starts = [0, *(number + 1 for number in separators)]
    ends = [*separators, len(lines)]
    return [
        _parse(f"{name}_{part}", lines[start:end], source, start + 1, is_defined)
        for part, start, end in zip(parts, starts, ends, strict=True)
    ]


def _parse(
    name: str, lines: list[str], source: str, first_line: int, is_defined: Callable[[str], bool]
) -> MessageDefinition:
    package = name.partition("/")[0]
    fields: dict[str, Field] = {}
    constants: dict[str, Constant] = {}
    for number, raw in enumerate(lines, first_line):
        line = raw.partition("#")[0].replace("\t", " ").strip()
        if not line:
            continue
        try:
            type_, _, rest = line.partition(" ")
            field, _, default = rest.strip().partition(" ")
            if "=" in rest:
                constant = _parse_constant(type_, rest)
                if constant.name in constants:
                    raise ValueError(f"constant '{constant.name}' is defined twice")
                constants[constant.name] = constant
            else:
                if field in fields:
                    raise ValueError(f"field '{field}' is defined twice")
                fields[field] = _parse_field(type_, field, default.strip(), package)
                base = fields[field].type.base
                if "/" in base and not is_defined(base):
                    raise ValueError(f"unknown type '{type_}': there is no definition of {base}")
        except ValueError as error:
            raise InvalidDefinition(f"{source}:{number}: {error}") from None
    return MessageDefinition(name, tuple(fields.values()), tuple(constants.values()))


def _parse_field(type_name: str, name: str, default: str, package: str) -> Field:
    type_ = _parse_type(type_name, package)
    if not _NAME.fullmatch(name):
        raise ValueError(
            f"'{name}' is not a field name: use lower case letters, digits and single underscores"
        )
    if iskeyword(name):
        raise ValueError(f"a field cannot have the name '{name}', a keyword of Python")
    if not default:
        return Field(name, type_)
    if type_.is_message:
        raise ValueError(f"field '{name}' is a message and cannot have a default value")
    if not type_.is_plural:
        return Field(name, type_, _parse_value(type_, default))
    values = tuple(_parse_value(type_, value) for value in _split(default))
    most = type_.array_size or type_.sequence_bound
    if len(values) > most > 0 or len(values) < type_.array_size:
        raise ValueError(f"'{name}' is {type_}, but has {len(values)} default values")
    return Field(name, type_, values)


def _parse_constant(type_name: str, rest: str) -> Constant:
    name, _, value = (part.strip() for part in rest.partition("="))
    if type_name not in _IDL_NAMES:
        raise ValueError(f"a constant cannot have the type '{type_name}': it must be a primitive or a string")
    if not _CONSTANT_NAME.fullmatch(name):
        raise ValueError(
            f"'{name}' is not a constant name: use upper case letters, digits and single underscores"
        )
    type_ = FieldType(_IDL_NAMES[type_name])
    return Constant(name, type_.base, _parse_value(type_, value))


def _parse_type(text: str, package: str) -> FieldType:
    match = _TYPE.fullmatch(text)
    if not match:
        raise ValueError(f"'{text}' is not a type")
    base, string_bound, size = match["base"], int(match["bound"] or 0), int(match["size"] or 0)
    if (match["bound"] and not string_bound) or (match["size"] and not size):
        raise ValueError(f"the bound in '{text}' must be greater than 0")
    if match["bound"] and base not in ("string", "wstring"):
        raise ValueError(
            f"'{text}': only strings have such a bound; write {base}[<={string_bound}] for a sequence"
        )
    if match["upper"] and not size:
        raise ValueError(f"the bound in '{text}' is missing")
    if base not in _IDL_NAMES:
        base = _message_name(base, package)
    sequence = bool(match["array"]) and (bool(match["upper"]) or not size)
    return FieldType(
        _IDL_NAMES.get(base, base),
        string_bound,
        array_size=0 if sequence else size,
        is_sequence=sequence,
        sequence_bound=size if sequence else 0,
    )


def _message_name(text: str, package: str) -> str:
    parts = text.split("/")
    if len(parts) == 1:
        parts.insert(0, package)
    if len(parts) != 2 or not _NAME.fullmatch(parts[0]) or not _TYPE_NAME.fullmatch(parts[1]):
        raise ValueError(f"unknown type '{text}'")
    return f"{parts[0]}/msg/{parts[1]}"


def _parse_value(field_type: FieldType, text: str) -> Literal:
    type_ = field_type.base
    if type_ in ("string", "wstring"):
        value = _unquote(text)
        if len(value) > field_type.string_bound > 0:
            raise ValueError(f"{text} is longer than {field_type.string_bound} characters")
        try:
            return _unescape_element(value) if field_type.is_plural else _unescape(value)
        except ValueError as error:
            raise ValueError(f"{text} is not a valid string: {error}") from None
    if type_ == "boolean":
        if text.lower() not in ("true", "false", "0", "1"):
            raise ValueError(f"'{text}' is not a valid bool: it must be true, false, 1 or 0")
        return text.lower() in ("true", "1")
    try:
        if type_ in ("float", "double"):
            return float(text)
        number = int(text) if text.lstrip("+-").isdecimal() else int(text, 0)
    except ValueError:
        raise ValueError(f"'{text}' is not a valid {type_}") from None
    low, high = integer_range(type_)
    if not low <= number <= high:
        raise ValueError(f"{text} is not a valid {type_}: it must be in [{low}, {high}]")
    return number


def integer_range(type_: str) -> tuple[int, int]:
    """Minimum and maximum of an IDL integer type or of an octet."""
    if type_ == "octet":
        return 0, 255
    bits = int(type_.lstrip("uint"))
    return (0, (1 << bits) - 1) if type_[0] == "u" else (-(1 << bits - 1), (1 << bits - 1) - 1)


def _unquote(text: str) -> str:
    for quote in "\"'":
        if len(text) > 1 and text[0] == text[-1] == quote:
            if not _QUOTED.fullmatch(text):
                raise ValueError(f"quotes inside {text} must be escaped")
            return text[1:-1].replace("\\" + quote, quote)
    return text


def _unescape(text: str) -> str:
    """The value that ROS 2 gives a string of the definition.

    An escape stands for a byte of UTF-8. The result is a literal of IDL, whose escapes are resolved in turn.
    """
    literal = _ESCAPE.sub(_character, text.encode().decode("latin-1")).encode("latin-1").decode()
    if not _IDL_STRING.fullmatch(literal):
        raise ValueError("before a quote or the end, write backslashes in groups of four")
    value = _IDL_ESCAPE.sub(_character, literal)
    return _in_one_line(re.sub(r'\\(["\\])', r"\1", value))


def _unescape_element(text: str) -> str:
    """The value that ROS 2 gives a string in an array, which it reads as a literal of Python."""
    return _in_one_line(_ESCAPE.sub(_character, text))


def _character(escape: re.Match[str]) -> str:
    return escape[0].encode().decode("unicode_escape")


def _in_one_line(value: str) -> str:
    if re.search(r"[\0\n\r]", value):
        raise ValueError("ROS 2 accepts neither NUL nor line breaks")
    value.encode()  # refuses surrogates
    return value


def _split(text: str) -> list[str]:
    """Elements of an array value ``[a, "b, c", d]``."""
    if not (text.startswith("[") and text.endswith("]")):
        raise ValueError(f"write the default value of an array in brackets, not {text}")
    inner = text[1:-1].strip()
    if not inner:
        return []
    elements = re.findall(rf"\s*({_QUOTED.pattern}|[^,]*?)\s*(?:,|$)", inner + ",")
    return elements[:-1] if elements and not elements[-1] else elements
