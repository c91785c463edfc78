"""Generates the functions that write messages as little-endian XCDR1, one for each type.

A generated function reads every field once, checks its type, and packs each run of values of fixed size
with one ``struct`` call. After a string or a sequence, the padding within a run depends on its position:
such a run has a table of packers, indexed by the position modulo its alignment. If a check fails,
:mod:`.validation` decides and finds the reason. A long sequence of numbers, such as an image, is not copied
if the caller takes :class:`.Pieces`.
"""

from __future__ import annotations

from array import array
from struct import Struct
from struct import error as struct_error
from typing import TYPE_CHECKING

from .definition_files import message_definition
from .fields import ARRAY_CODES, slot_of
from .generator import Generator
from .layout import CODES, HEADER_SIZE, SIZES, Item, run_alignment, run_format
from .pieces import LARGE
from .validation import elements, validate

if TYPE_CHECKING:
    from collections.abc import Callable

    from .definition import Field, FieldType, MessageDefinition
    from .pieces import Pieces

_PYTHON_TYPES = {
    "boolean": "bool",
    "octet": "bytes",
    "float": "float",
    "double": "float",
    "string": "str",
    "wstring": "str",
}
_NUL = Item("x", 1)


def make_serializer(
    definition: MessageDefinition, message_class: Callable[[str], type]
) -> Callable[..., bytes | Pieces]:
    """Function from a message to bytes. It raises TypeError or ValueError with type, field and value.

    With :class:`.Pieces` as its second argument, it returns one for a message with a long sequence.
    """
    return _SerializerGenerator(definition, message_class).compile()


class _SerializerGenerator(Generator):
    def __init__(self, definition: MessageDefinition, message_class: Callable[[str], type]) -> None:
        super().__init__(
            definition, message_class, array=array, elements=elements, validate=validate, error=struct_error
        )
        self._checks: list[str] = []  # conditions that must be false for the values in the run

    def compile(self) -> Callable[..., bytes | Pieces]:
        self._checks.append("type(m) is not cls")
        self._run.append(Item("xB2x", HEADER_SIZE, 1, "1"))
        self._message("m", self._definition)
        self._flush()
        has_loop = any(line.lstrip().startswith("for ") for line in self._lines)
        # a bytearray grows in place; bytes are faster for few parts
        first = next(number for number, line in enumerate(self._lines) if "out = " in line)
        if has_loop:
            self._lines[first] = self._lines[first].replace("out = ", "out = bytearray(") + ")"
            self._lines.insert(0, "  valid = False")
        code = [
            "def serialize(m, pieces=None):",
            " try:",
            *self._lines,
            "  return bytes(out) if type(out) is bytearray else out" if has_loop else "  return out",
            " except (error, AttributeError, TypeError, ValueError, OverflowError) as error_:",
            "  problem = error_",
            " validate(m, cls)",
            " raise problem",
        ]
        return self._compiled("serialize", code)

    def _message(self, message: str, definition: MessageDefinition) -> None:
        if not definition.fields:
            self._run.append(_NUL)
        for field in definition.fields:
            value = self._variable()
            self._emit(f"{value} = {message}.{slot_of(field)}")
            self._field(value, field)

    def _field(self, value: str, field: Field) -> None:
        type_ = field.type
        if not type_.is_plural:
            self._single(value, type_)
        elif type_.base in ARRAY_CODES:
            self._numbers(value, type_)
        else:
            self._list(value, type_)

    def _single(self, value: str, type_: FieldType) -> None:
        if type_.is_message:
            self._checks.append(f"type({value}) is not {self._name(self._message_class(type_.base))}")
            self._message(value, message_definition(type_.base))
            return
        self._checks.append(f"type({value}) is not {_PYTHON_TYPES.get(type_.base, 'int')}")
        if type_.string_bound:
            self._checks.append(f"len({value}) > {type_.string_bound}")
        if type_.base == "string":
            data = self._variable()
            self._emit(f"{data} = {value}.encode()")
            self._checks.append(f"0 in {data}")
            self._run.append(Item("I", 4, 4, f"len({data}) + 1"))
            self._append(data)
            self._run.append(_NUL)
        elif type_.base == "wstring":
            # Jazzy sends UTF-16 code units in 4 bytes each, without a terminator
            data = self._variable()
            self._emit(f"{data} = array('I', array('H', {value}.encode('utf-16-le')))")
            self._run.append(Item("I", 4, 4, f"len({data})"))
            self._append(data)
        else:
            size = SIZES[type_.base]
            self._run.append(Item(CODES[type_.base], size, size, value))

    def _numbers(self, value: str, type_: FieldType) -> None:
        size = SIZES[type_.base]
        if type_.array_size:
            total = size * type_.array_size
            self._run.append(Item(f"{total}s", total, size, f"{value}.tobytes()"))
            return
        if type_.sequence_bound:
            self._checks.append(f"len({value}) > {type_.sequence_bound}")
        self._run.append(Item("I", 4, 4, f"len({value})"))
        self._flush()
        if size > 4:
            padding = self._name(tuple(bytes((HEADER_SIZE - position) % size) for position in range(size)))
            self._emit(f"if {value}: out += {padding}[len(out) & {size - 1}]")
        self._emit(f"if pieces and len({value}) >= {LARGE // size}: out = pieces(out); pieces = None")
        self._append(value)

    def _list(self, value: str, type_: FieldType) -> None:
        self._emit(f"if type({value}) is not list: {value} = elements({value}, {type_.base!r})")
        if type_.array_size:
            self._checks.append(f"len({value}) != {type_.array_size}")
        else:
            if type_.sequence_bound:
                self._checks.append(f"len({value}) > {type_.sequence_bound}")
            self._run.append(Item("I", 4, 4, f"len({value})"))
        self._flush()
        self._position = None
        element = self._variable()
        self._emit(f"for {element} in {value}:")
        self._indent += 1
        self._single(element, type_._replace(array_size=0, is_sequence=False, sequence_bound=0))
        self._flush()
        self._position = None
        self._indent -= 1

    def _append(self, data: str) -> None:
        """Append bytes whose number is known only at run time."""
        self._flush()
        self._emit(f"out += {data}")
        self._position = None

    def _flush(self) -> None:
        if self._checks:
            wrong = " or ".join(self._checks)
            if self._indent > 2:
                # in a loop, validate only once: values of subclasses are valid, but fail the quick check
                self._emit(f"if ({wrong}) and not valid: validate(m, cls); valid = True")
            else:
                self._emit(f"if {wrong}: validate(m, cls)")
            self._checks.clear()
        if not self._run:
            return
        arguments = ", ".join(item.value for item in self._run if item.value)
        if not arguments:
            packed = self._name(bytes(len(self._run)))
        elif self._position is None:
            alignment = run_alignment(self._run)
            packers = tuple(Struct(run_format(self._run, position)[0]).pack for position in range(alignment))
            packed = f"{self._name(packers)}[len(out) & {alignment - 1}]({arguments})"
        else:
            format_, _ = run_format(self._run, self._position)
            packed = f"{self._name(Struct(format_).pack)}({arguments})"
        self._emit(f"out {'=' if self._position == 0 else '+='} {packed}")
        if self._position is not None:
            self._position = run_format(self._run, self._position)[1]
        self._run.clear()
