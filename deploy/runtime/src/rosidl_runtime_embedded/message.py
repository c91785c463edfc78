"""Message classes with the interface of those that Jazzy's ``rosidl_generator_py`` generates."""

from __future__ import annotations

import os
from array import array
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

from . import generated
from .definition_files import message_definition
from .fields import converter, initial_value, is_numeric, numeric_field, python_value, slot_of
from .interface_class import make_class
from .validation import validate_assignment

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Self

    from rosidl_parser.definition import AbstractType

    from .definition import Field, MessageDefinition
    from .pieces import Pieces

_CHECK_FIELDS = os.environ.get("ROS_PYTHON_CHECK_FIELDS") == "1"
"""Whether messages check assigned values by default."""
_FLAG = "_check__fields"
"""The slot for ``check_fields`` of the constructor. No field name contains two underscores in a row."""


class _OnFirstUse:
    """A member of a message class that is made on its first use.

    A process imports many types and uses few; compiling the code of one takes as long as a hundred uses.
    """

    def __init__(self, make: Callable[[type[Message]], Any]) -> None:
        self._make = make

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: object, owner: type[Message]) -> Any:
        cls = _message_class(owner)
        setattr(cls, self._name, self._make(cls))
        return getattr(cls, self._name)


def _message_class(cls: type[Message]) -> type[Message]:
    """The class that was made for a definition: the class itself, or the base of a user's class."""
    return next(base for base in cls.__mro__ if "_DEFINITION" in vars(base))


@cache
def _check_assignments(cls: type[Message]) -> None:
    """Give the class properties that check assigned values if the message has ``check_fields``.

    Until then, fields are plain slots, so messages that check nothing stay fast.
    """
    for field in cls._DEFINITION.fields:
        setattr(cls, field.name, _checked(getattr(cls, field.name), cls._TYPE_NAME, field))


def _checked(unchecked: Any, type_name: str, field: Field) -> property:
    """Property of a field that checks values if its message checks fields."""

    def set_checked(self: object, value: object) -> None:
        if not getattr(self, _FLAG, _CHECK_FIELDS):
            unchecked.__set__(self, value)
            return
        try:
            validate_assignment(value, field, type_name)
            unchecked.__set__(self, value)
        except (TypeError, ValueError) as error:
            raise AssertionError(error) from None

    return property(unchecked.__get__, set_checked, unchecked.__delete__)


def _make_constructor(cls: type[Message]) -> Callable[..., None]:
    """Compile ``__init__`` with a keyword for each field, whose default is the initial value of the field."""
    # no field name begins with an underscore, so no field hides one of these
    names: dict[str, Any] = {
        "_unset": object(),
        "_default": _CHECK_FIELDS,
    }
    parameters: list[str] = []
    body: list[str] = []
    options: list[str] = []
    if all(field.name != "check_fields" for field in cls._DEFINITION.fields):
        options.append("check_fields=_default")
        body.append("if check_fields is not _default: _self._check_fields = check_fields")
    for field in cls._DEFINITION.fields:
        name, initial = field.name, f"_initial_{field.name}"
        names[initial], is_factory = initial_value(field, message_class)
        if is_factory:
            given = name
            if is_numeric(field):
                # as in rclpy, converted before the check
                given = f"_convert_{name}({name})"
                names[f"_convert_{name}"] = converter(cls._TYPE_NAME, field)
            parameters.append(f"{name}=_unset")
            body.append(f"_self.{slot_of(field)} = {initial}() if {name} is _unset else {given}")
        else:
            parameters.append(f"{name}={initial}")
            body.append(f"_self.{name} = {name}")
    arguments = ", ".join(["_self", "/", "*", *parameters, *options])
    generated.run(f"def __init__({arguments}):\n " + "\n ".join(body), names)
    constructor: Callable[..., None] = names["__init__"]
    constructor.__qualname__ = f"{cls.__name__}.__init__"
    return constructor


def _make_serializer(cls: type[Message]) -> Any:
    from .serializer import make_serializer

    return staticmethod(make_serializer(cls._DEFINITION, message_class))


def _make_deserializer(cls: type[Message]) -> Any:
    from .deserializer import make_deserializer

    return staticmethod(make_deserializer(cls._DEFINITION, message_class))


def _make_type_hash(cls: type[Message]) -> str:
    from .type_hash import type_hash

    return type_hash(cls._TYPE_NAME)


def _make_slot_types(cls: type[Message]) -> tuple[AbstractType, ...]:
    from .slot_types import slot_type

    return tuple(slot_type(field.type) for field in cls._DEFINITION.fields)


class Message:
    """Base of all message classes.

    By default, as in rclpy of Jazzy, serialization checks the fields, that is, publishing does. The
    assignment of an array or sequence of numbers converts and checks it. A message with
    ``check_fields=True``, or with ROS_PYTHON_CHECK_FIELDS=1 in the environment, checks every assignment and
    raises AssertionError.
    """

    __slots__ = ()
    _DEFINITION: ClassVar[MessageDefinition]
    _TYPE_NAME: ClassVar[str]
    """``std_msgs/msg/Float64``"""
    _DDS_TYPE_NAME: ClassVar[str]
    """``std_msgs::msg::dds_::Float64_``"""
    _fields_and_field_types: ClassVar[dict[str, str]]

    if TYPE_CHECKING:
        _TYPE_HASH: ClassVar[str]
        """``RIHS01_…``"""
        SLOT_TYPES: ClassVar[tuple[AbstractType, ...]]
        """The types of the fields, in order."""

        @staticmethod
        def _serialize(message: Any, pieces: type[Pieces] | None = None) -> Any:
            """Little-endian XCDR1: bytes, or, if asked for, the pieces of a message with a long sequence.

            Raises TypeError or ValueError naming type, field and value.
            """

        @classmethod
        def _deserialize(cls, data: bytes | memoryview) -> Self:
            """Message from little-endian XCDR1 with its header. Raises ValueError for other bytes.

            The message may keep a memoryview, which must not change.
            """
    else:

        def __init__(self, /, *args, **fields):
            cls = _message_class(type(self))
            cls.__init__ = _make_constructor(cls)
            cls.__init__(self, *args, **fields)

        _serialize = _OnFirstUse(_make_serializer)
        _deserialize = _OnFirstUse(_make_deserializer)
        _TYPE_HASH = _OnFirstUse(_make_type_hash)
        SLOT_TYPES = _OnFirstUse(_make_slot_types)

    @property
    def _check_fields(self) -> bool:
        return bool(getattr(self, _FLAG, _CHECK_FIELDS))

    @_check_fields.setter
    def _check_fields(self, check: bool) -> None:
        setattr(self, _FLAG, check)
        if check:
            cls: type = _message_class(type(self))
            _check_assignments(cls)

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """Names of the fields and their types, in order."""
        return dict(cls._fields_and_field_types)

    def __repr__(self) -> str:
        values = ((name, getattr(self, name)) for name in self._fields_and_field_types)
        fields = (
            f"{name}={value.tolist() if isinstance(value, array) else value!r}" for name, value in values
        )
        module = self.__module__.rpartition(".")[0]
        return f"{module}{'.' if module else ''}{type(self).__name__}({', '.join(fields)})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, self.__class__):
            return False
        for name in self._fields_and_field_types:
            equal = getattr(self, name) == getattr(other, name)
            if not (equal if isinstance(equal, bool) else equal.all()):
                return False
        return True

    __hash__ = None  # type: ignore[assignment]


_classes: dict[str, type[Message]] = {}


def message_class(name: str) -> type[Message]:
    """Class of a message, or of one in a service or action, by its full name.

    Raises LookupError or InvalidDefinition.
    """
    if name not in _classes:
        # setdefault: two threads that get here at once must see the same class
        _classes.setdefault(name, _make_message_class(message_definition(name)))
    return _classes[name]


def _make_message_class(definition: MessageDefinition) -> type[Message]:
    package, kind, name = definition.name.split("/")
    namespace: dict[str, Any] = {
        "__doc__": f"Message {definition.name}.",
        "__slots__": (*(slot_of(field) for field in definition.fields), _FLAG),
        "_DEFINITION": definition,
        "_DDS_TYPE_NAME": f"{package}::{kind}::dds_::{name}_",
        "_fields_and_field_types": {field.name: str(field.type) for field in definition.fields},
    }
    constants = {
        constant.name: python_value(constant.type, constant.value) for constant in definition.constants
    }
    for field in definition.fields:
        if is_numeric(field):
            namespace[field.name] = numeric_field(definition.name, field)
        if field.default is not None:
            initial, is_factory = initial_value(field, message_class)
            constants[f"{field.name.upper()}__DEFAULT"] = initial() if is_factory else initial
    cls: type = make_class(Message, definition.name, namespace, constants)
    # __slots__ lists the names of rclpy. The real slots have the names of the fields, faster than a property.
    slots = []
    for field in definition.fields:
        slot = f"_{field.name}"
        if slot in vars(Message) or slot in namespace:  # the name of a member of Message
            slot = field.name
        else:
            setattr(cls, slot, vars(cls)[field.name])
        slots.append(slot)
    cls.__slots__ = [*slots, "_check_fields"]  # type: ignore[attr-defined]
    if _CHECK_FIELDS:
        _check_assignments(cls)
    return cls
