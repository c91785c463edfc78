"""Generates the functions that read messages from little-endian XCDR1, one for each type.

The counterpart of :mod:`.serializer`. A memoryview is memory that DDS lends: a long sequence of numbers,
such as an image, stays there until it is first read (:func:`.fields.numeric_field`). Samples are
untrusted: a count allocates and repeats nothing if the sample is too short for it, and every malformed
sample raises ValueError. Only the bounds of strings are not checked, as in ROS 2, where C++ sends longer
strings. With ROS_PYTHON_CHECK_FIELDS=1 the assignment to the field checks them; its AssertionError becomes a
ValueError.
"""

from __future__ import annotations

from array import array
from struct import Struct
from struct import error as struct_error
from typing import TYPE_CHECKING, Any

from .definition_files import message_definition
from .fields import ARRAY_CODES, slot_of
from .generator import Generator
from .layout import (
    CODES,
    HEADER_SIZE,
    LITTLE_ENDIAN_CDR,
    SIZES,
    Item,
    run_alignment,
    run_format,
    smallest_size,
)
from .pieces import LARGE

if TYPE_CHECKING:
    from collections.abc import Callable

    from .definition import FieldType, MessageDefinition


def make_deserializer(
    definition: MessageDefinition, message_class: Callable[[str], type]
) -> Callable[[bytes | memoryview], Any]:
    """Function from bytes to a message. It raises ValueError, and only that, for malformed bytes."""
    return _DeserializerGenerator(definition, message_class).compile()


def _malformed(cls: Any, data: bytes | memoryview, reason: object) -> ValueError:
    return ValueError(f"{len(data)} bytes are not a valid {cls._TYPE_NAME}: {reason}")


def _bools(data: bytes | memoryview) -> list[bool]:
    if data and max(data) > 1:
        raise ValueError("a bool is neither 0 nor 1")
    return [byte == 1 for byte in data]


def _octets(data: bytes | memoryview) -> list[bytes]:
    octets = bytes(data)
    return [octets[index : index + 1] for index in range(len(octets))]


def _text(data: bytes | memoryview) -> str:
    # as in rclpy: a string ends at its first NUL, and invalid UTF-8 is replaced
    text = str(data, "utf-8", "replace")
    return text.partition("\0")[0] if "\0" in text else text


def _wide_text(data: bytes | memoryview) -> str:
    try:
        units = array("H", array("I", bytes(data)))
    except OverflowError:
        raise ValueError("a wide string is not UTF-16") from None
    return units.tobytes().decode("utf-16-le")


class _DeserializerGenerator(Generator):
    """In the generated code, ``p`` is the position where it is known only at run time."""

    def __init__(self, definition: MessageDefinition, message_class: Callable[[str], type]) -> None:
        super().__init__(
            definition,
            message_class,
            array=array,
            booleans=_bools,
            error=struct_error,
            malformed=_malformed,
            new=object.__new__,
            octets=_octets,
            text=_text,
            wide_text=_wide_text,
        )
        self._after: list[str] = []  # lines to emit after the run is read

    def compile(self) -> Callable[[bytes | memoryview], Any]:
        self._run.append(Item("H2x", HEADER_SIZE, 1, "h"))
        self._after.append(
            f"if h != {LITTLE_ENDIAN_CDR}: raise ValueError('its header is not that of little-endian CDR')"
        )
        result = self._message(self._definition)
        self._flush()
        code = [
            "def deserialize(data):",
            " try:",
            "  end = len(data)",
            *self._lines,
            " except (error, IndexError, ValueError, AssertionError) as reason:",
            "  raise malformed(cls, data, reason) from None",
            f" return {result}",
        ]
        if not any("end" in line for line in self._lines):
            code.remove("  end = len(data)")
        return self._compiled("deserialize", code)

    def _message(self, definition: MessageDefinition) -> str:
        """Emit code that reads a message; return its variable."""
        message = self._variable()
        self._emit(f"{message} = new({self._name(self._message_class(definition.name))})")
        if not definition.fields:
            self._run.append(Item("x", 1))
        for field in definition.fields:
            target = f"{message}.{slot_of(field)}"
            if not field.type.is_plural:
                self._single(target, field.type)
            elif field.type.base in (*ARRAY_CODES, "boolean", "octet"):
                self._plain_elements(target, field.type)
            else:
                self._list(target, field.type)
        return message

    def _single(self, target: str, type_: FieldType) -> None:
        if type_.is_message:
            self._after.append(f"{target} = {self._message(message_definition(type_.base))}")
        elif type_.base in ("string", "wstring"):
            self._text(target, type_.base)
        else:
            value, size = self._variable(), SIZES[type_.base]
            if type_.base == "boolean":
                self._run.append(Item("B", size, size, value))
                self._after.append(f"if {value} > 1: raise ValueError('a bool is neither 0 nor 1')")
                self._after.append(f"{target} = {value} == 1")
            else:
                self._run.append(Item(CODES[type_.base], size, size, value))
                self._after.append(f"{target} = {value}")

    def _text(self, target: str, base: str) -> None:
        length = self._variable()
        self._run.append(Item("I", 4, 4, length))
        self._flush_to_variable()
        if base == "wstring":
            self._emit(f"q = p + {length} * 4")
            self._emit("if q > end: raise ValueError('it is too short')")
            self._emit(f"{target} = wide_text(data[p:q])")
            self._emit("p = q")
            return
        self._emit(f"if {length}:")
        self._emit(f" q = p + {length} - 1")
        self._emit(" if data[q]: raise ValueError('a string is not terminated')")
        self._emit(f" {target} = text(data[p:q])")
        self._emit(" p = q + 1")
        self._emit(f"else: {target} = ''")

    def _plain_elements(self, target: str, type_: FieldType) -> None:
        """Emit code that reads an array or sequence whose elements are contiguous."""
        code, size = ARRAY_CODES.get(type_.base), SIZES[type_.base]
        if type_.array_size:
            data = self._variable()
            self._run.append(Item(f"{size * type_.array_size}s", size * type_.array_size, size, data))
            make = f"array('{code}', {data})" if code else f"{type_.base}s({data})"
            self._after.append(f"{target} = {make}")
            return
        count = self._count(type_)
        if size > 4:
            self._emit(f"if {count}: p += {HEADER_SIZE} - p & {size - 1}")
        self._emit(f"q = p + {count} * {size}")
        self._emit("if q > end: raise ValueError('it is too short')")
        if code:
            self._emit(f"if {count} >= {LARGE // size} and type(data) is memoryview:")
            self._emit(f" {target} = data[p:q].cast('{code}')")
            self._emit("else:")
            numbers = self._variable()
            self._emit(f" {target} = {numbers} = array('{code}')")
            self._emit(f" {numbers}.frombytes(memoryview(data)[p:q])")
        else:
            self._emit(f"{target} = {type_.base}s(data[p:q])")
        self._emit("p = q")

    def _list(self, target: str, type_: FieldType) -> None:
        if type_.array_size:
            self._flush_to_variable()
            count = str(type_.array_size)
        else:
            smallest = smallest_size(message_definition(type_.base)) if type_.is_message else 4
            count = self._count(type_)
            # before the loop: refuse a count that the rest of the sample cannot hold
            self._emit(f"if {count} * {smallest} > end - p: raise ValueError('it is too short')")
        elements, element = self._variable(), self._variable()
        self._emit(f"{elements} = []")
        self._emit(f"for _ in range({count}):")
        self._indent += 1
        self._single(element, type_._replace(array_size=0, is_sequence=False, sequence_bound=0))
        self._flush_to_variable()
        self._emit(f"{elements}.append({element})")
        self._indent -= 1
        self._emit(f"{target} = {elements}")

    def _count(self, type_: FieldType) -> str:
        """Emit code that reads the length of a sequence; return its variable."""
        count = self._variable()
        self._run.append(Item("I", 4, 4, count))
        self._flush_to_variable()
        if type_.sequence_bound:
            self._emit(f"if {count} > {type_.sequence_bound}: raise ValueError('a sequence is too long')")
        return count

    def _flush_to_variable(self) -> None:
        """Flush, and keep the position in ``p`` from here on."""
        self._flush()
        if self._position is not None:
            self._emit(f"p = {self._position}")
            self._position = None

    def _flush(self) -> None:
        """Emit code that reads the collected run, and the lines that wait for it."""
        if self._run:
            values = "".join(f"{item.value}, " for item in self._run if item.value)
            if self._position is None:
                alignment = run_alignment(self._run)
                formats = (run_format(self._run, position) for position in range(alignment))
                table = [
                    (Struct(format_).unpack_from, end - start) for start, (format_, end) in enumerate(formats)
                ]
                self._emit(f"u, s = {self._name(tuple(table))}[p & {alignment - 1}]")
                self._emit(f"{values and f'{values}= '}u(data, p)")
                self._emit("p += s")
            else:
                format_, end = run_format(self._run, self._position)
                unpack = self._name(Struct(format_).unpack_from)
                self._emit(f"{values and f'{values}= '}{unpack}(data, {self._position})")
                self._position = end
            self._run.clear()
        for line in self._after:
            self._emit(line)
        self._after.clear()
