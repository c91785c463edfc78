"""Code that reads a message type from little-endian XCDR1, made and compiled per type.

The counterpart of :mod:`.serializer`. A sample comes from anywhere: nothing is allocated or repeated on the
word of a count that the sample is too short for, and whatever is malformed raises ValueError. The bounds of
strings alone are not checked, as no ROS 2 checks them: C++ sends longer ones. With ROS_PYTHON_CHECK_FIELDS=1
they are, by the assignment to the field; its AssertionError becomes a ValueError like the others.
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

if TYPE_CHECKING:
    from collections.abc import Callable

    from .definition import FieldType, MessageDefinition


def make_deserializer(
    definition: MessageDefinition, message_class: Callable[[str], type]
) -> Callable[[bytes], Any]:
    """Function from bytes to a message of the class; for all else it raises ValueError and nothing else."""
    return _DeserializerGenerator(definition, message_class).compile()


def _malformed(cls: Any, data: bytes, reason: object) -> ValueError:
    return ValueError(f"{len(data)} bytes are no {cls._TYPE_NAME}: {reason}")


def _bools(data: bytes) -> list[bool]:
    if data and max(data) > 1:
        raise ValueError("a bool is neither 0 nor 1")
    return [byte == 1 for byte in data]


def _octets(data: bytes) -> list[bytes]:
    return [data[index : index + 1] for index in range(len(data))]


def _text(data: bytes) -> str:
    # as rclpy: a string ends at its first NUL, and what is not UTF-8 is replaced
    return data.decode("utf-8", "replace").partition("\0")[0]


def _wide_text(data: bytes) -> str:
    try:
        units = array("H", array("I", data))
    except OverflowError:
        raise ValueError("a wide string is not UTF-16") from None
    return units.tobytes().decode("utf-16-le")


class _DeserializerGenerator(Generator):
    """The variable ``p`` has the position where it is known at run time only."""

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
        self._after: list[str] = []  # what can be done once the run is read

    def compile(self) -> Callable[[bytes], Any]:
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
        """Read a message; the name of the variable that holds it."""
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
        """Read an array or a sequence whose elements lie one after the other without anything in between."""
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
            # through a view: a copy of an image costs more than all the rest
            numbers = self._variable()
            self._emit(f"{target} = {numbers} = array('{code}')")
            self._emit(f"{numbers}.frombytes(memoryview(data)[p:q])")
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
            # before the loop: what a sample claims is not believed for longer than it is
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
        """Read the number of elements of a sequence; the variable that has it."""
        count = self._variable()
        self._run.append(Item("I", 4, 4, count))
        self._flush_to_variable()
        if type_.sequence_bound:
            self._emit(f"if {count} > {type_.sequence_bound}: raise ValueError('a sequence is too long')")
        return count

    def _flush_to_variable(self) -> None:
        """Flush, and have the position in variable p from here on."""
        self._flush()
        if self._position is not None:
            self._emit(f"p = {self._position}")
            self._position = None

    def _flush(self) -> None:
        """Read the run gathered so far, and do what waits for it."""
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
