"""Message classes, in the shape that ``rosidl_generator_py`` of Jazzy gives them."""

from __future__ import annotations

import os
from array import array
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

from . import generated
from .definition_files import message_definition
from .fields import converter, initial_value, is_numeric, numeric_field, python_value, slot_of
from .validation import validate_assignment

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Self

    from rosidl_parser.definition import AbstractType

    from .definition import Field, MessageDefinition

_CHECK_FIELDS = os.environ.get("ROS_PYTHON_CHECK_FIELDS") == "1"
"""Whether messages check what they are assigned if their constructors are not told."""
_FLAG = "_check_fields_"
"""The slot of what their constructors are told. No field's name ends with an underscore."""


class _OnFirstUse:
    """A member of a message class that is made when it is first asked for.

    A process imports many types and uses few: compiling the code of one takes as long as a hundred uses.
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
    """The class that was made for a definition: the class itself, or the one that a user derived it from."""
    return next(base for base in cls.__mro__ if "_DEFINITION" in vars(base))


@cache
def _check_assignments(cls: type[Message]) -> None:
    """Let messages of the class check what they are assigned, those that are to.

    Fields are plain slots until the first message of the class is to check: so the others pay nothing for it.
    """
    for field in cls._DEFINITION.fields:
        setattr(cls, field.name, _checked(getattr(cls, field.name), cls._TYPE_NAME, field))


def _checked(unchecked: Any, type_name: str, field: Field) -> property:
    """The property of a field that checks values for messages that check fields."""

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
    """Compile ``__init__``: a keyword for each field, with the field's initial value as default."""
    # no field begins with an underscore: so the names of fields hide none of these
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
                # as in rclpy: converted before it could be checked
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

    As in rclpy of Jazzy by default, fields are checked when a message is serialized: at publish. Arrays
    and sequences of numbers are checked when they are assigned, since they are converted then. A message
    made with ``check_fields=True``, or with ROS_PYTHON_CHECK_FIELDS=1 in the environment, checks all fields
    when they are assigned: what is wrong is an AssertionError.
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
        def _serialize(message: Any) -> bytes:
            """Little-endian XCDR1. Raises TypeError or ValueError naming type, field and value."""

        @classmethod
        def _deserialize(cls, data: bytes) -> Self:
            """Message from little-endian XCDR1 with its header. Raises ValueError for anything else."""
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
        """Whether this message checks what it is assigned."""
        return bool(getattr(self, _FLAG, _CHECK_FIELDS))

    @_check_fields.setter
    def _check_fields(self, check: bool) -> None:
        setattr(self, _FLAG, check)
        if check:
            cls: type = _message_class(type(self))
            _check_assignments(cls)

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """Names of the fields and of their types, in order."""
        return dict(cls._fields_and_field_types)

    def __repr__(self) -> str:
        """Text as rclpy's: an ``array.array`` looks like a list."""
        values = ((name, getattr(self, name)) for name in self._fields_and_field_types)
        fields = (
            f"{name}={value.tolist() if isinstance(value, array) else value!r}" for name, value in values
        )
        return f"{self.__module__}.{type(self).__name__}({', '.join(fields)})"

    def __eq__(self, other: object) -> bool:
        """Whether both are of one type and have equal fields."""
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
    """Class of a message or a service's part by full name. Raises LookupError or InvalidDefinition."""
    if name not in _classes:
        # setdefault: of two threads that get here at once, both must see one class
        _classes.setdefault(name, _make_message_class(message_definition(name)))
    return _classes[name]


def _make_message_class(definition: MessageDefinition) -> type[Message]:
    """Make the class of a message type."""
    package, kind, name = definition.name.split("/")
    namespace: dict[str, Any] = {
        "__module__": f"{package}.{kind}",
        "__doc__": f"Message {definition.name}.",
        "__slots__": (*(slot_of(field) for field in definition.fields), _FLAG),
        "_DEFINITION": definition,
        "_TYPE_NAME": definition.name,
        "_DDS_TYPE_NAME": f"{package}::{kind}::dds_::{name}_",
        "_fields_and_field_types": {field.name: str(field.type) for field in definition.fields},
    }
    for field in definition.fields:
        if is_numeric(field):
            namespace[field.name] = numeric_field(definition.name, field)
        if field.default is not None:
            initial, is_factory = initial_value(field, message_class)
            namespace[f"{field.name.upper()}__DEFAULT"] = initial() if is_factory else initial
    for constant in definition.constants:
        namespace[constant.name] = python_value(constant.type, constant.value)
    cls = type(name, (Message,), namespace)
    # Whoever walks the slots is to find those of rclpy; ours are the fields as such: no property is as fast.
    slots = []
    for field in definition.fields:
        slot = f"_{field.name}"
        if slot in vars(Message) or slot in namespace:  # messages need it themselves
            slot = field.name
        else:
            setattr(cls, slot, vars(cls)[field.name])
        slots.append(slot)
    cls.__slots__ = [*slots, "_check_fields"]  # type: ignore[attr-defined]
    if _CHECK_FIELDS:
        _check_assignments(cls)
    return cls
