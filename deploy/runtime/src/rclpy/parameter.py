"""Parameters: named, typed values of a node, and their conversion from and to messages and YAML."""

from __future__ import annotations

import array
from enum import Enum
from typing import TYPE_CHECKING, Any, TypeAlias

from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterType, ParameterValue

if TYPE_CHECKING:
    AllowableParameterValue: TypeAlias = (
        bool
        | int
        | float
        | str
        | list[bytes]
        | tuple[bytes, ...]
        | list[bool]
        | tuple[bool, ...]
        | list[int]
        | tuple[int, ...]
        | array.array[int]
        | list[float]
        | tuple[float, ...]
        | array.array[float]
        | list[str]
        | tuple[str, ...]
        | None
    )
else:  # array.array is not subscriptable at run time
    AllowableParameterValue = Any

PARAMETER_SEPARATOR_STRING = "."


class Parameter:
    """A parameter: its name, type and value. Immutable."""

    __slots__ = ("__weakref__", "_name", "_type_", "_value")

    class Type(Enum):
        """The type of a parameter's value; the numbers are those of `rcl_interfaces/msg/ParameterType`."""

        NOT_SET = ParameterType.PARAMETER_NOT_SET
        BOOL = ParameterType.PARAMETER_BOOL
        INTEGER = ParameterType.PARAMETER_INTEGER
        DOUBLE = ParameterType.PARAMETER_DOUBLE
        STRING = ParameterType.PARAMETER_STRING
        BYTE_ARRAY = ParameterType.PARAMETER_BYTE_ARRAY
        BOOL_ARRAY = ParameterType.PARAMETER_BOOL_ARRAY
        INTEGER_ARRAY = ParameterType.PARAMETER_INTEGER_ARRAY
        DOUBLE_ARRAY = ParameterType.PARAMETER_DOUBLE_ARRAY
        STRING_ARRAY = ParameterType.PARAMETER_STRING_ARRAY

        @classmethod
        def from_parameter_value(cls, parameter_value: Any) -> Parameter.Type:
            """Return the type of a value; of an empty list, a byte array. Raises TypeError if it has none."""
            if parameter_value is None:
                return cls.NOT_SET
            for scalar, type_ in _SCALARS.items():
                if isinstance(parameter_value, scalar):
                    return type_
            if not isinstance(parameter_value, (list, tuple, array.array)):
                raise TypeError(f"The given value is not one of the allowed types '{parameter_value}'.")
            for element, type_ in _ELEMENTS.items():
                if all(isinstance(value, element) for value in parameter_value):
                    return type_
            raise TypeError(f"The given value is not a list of one of the allowed types '{parameter_value}'.")

        def check(self, parameter_value: Any) -> bool:
            """Return whether the value is of this type."""
            if self is Parameter.Type.NOT_SET:
                return parameter_value is None
            python_type = _PYTHON_TYPES[self]
            if self in _SCALARS.values():
                return isinstance(parameter_value, python_type)
            numeric = self in (Parameter.Type.INTEGER_ARRAY, Parameter.Type.DOUBLE_ARRAY)
            if not isinstance(parameter_value, (list, tuple, array.array) if numeric else (list, tuple)):
                return False
            if self is Parameter.Type.BYTE_ARRAY:
                return all(isinstance(value, bytes) and len(value) == 1 for value in parameter_value)
            return all(isinstance(value, python_type) for value in parameter_value)

    @classmethod
    def from_parameter_msg(cls, param_msg: ParameterMsg) -> Parameter:
        type_ = Parameter.Type(param_msg.value.type)
        value = None if type_ is Parameter.Type.NOT_SET else getattr(param_msg.value, _field(type_))
        return cls(param_msg.name, type_, value)

    def __init__(self, name: str, type_: Parameter.Type | None = None, value: Any = None) -> None:
        """Create a parameter; by default, its type is that of the value.

        :raises TypeError: if `type_` is not a type, or if it is missing and no type fits the value.
        :raises ValueError: if the value does not have the type.
        """
        if type_ is None:
            type_ = Parameter.Type.from_parameter_value(value)
        if not isinstance(type_, Parameter.Type):
            raise TypeError(f"type must be an instance of '{Parameter.Type!r}'")
        if not type_.check(value):
            raise ValueError(f"Type '{type_}' and value '{value}' do not agree")
        self._type_ = type_
        self._name = name
        self._value = value

    @property
    def name(self) -> str:
        return self._name

    @property
    def type_(self) -> Parameter.Type:
        return self._type_

    @property
    def value(self) -> Any:
        """The value; `None` if it is not set."""
        return self._value

    def get_parameter_value(self) -> ParameterValue:
        message = ParameterValue(type=self._type_.value)
        if self._type_ is not Parameter.Type.NOT_SET:
            setattr(message, _field(self._type_), self._value)
        return message

    def to_parameter_msg(self) -> ParameterMsg:
        return ParameterMsg(name=self._name, value=self.get_parameter_value())


# The order matters for the type of a value: a bool is also an int, and an empty list is a list of bytes.
_SCALARS: dict[type, Parameter.Type] = {
    bool: Parameter.Type.BOOL,
    int: Parameter.Type.INTEGER,
    float: Parameter.Type.DOUBLE,
    str: Parameter.Type.STRING,
}
_ELEMENTS: dict[type, Parameter.Type] = {
    bytes: Parameter.Type.BYTE_ARRAY,
    bool: Parameter.Type.BOOL_ARRAY,
    int: Parameter.Type.INTEGER_ARRAY,
    float: Parameter.Type.DOUBLE_ARRAY,
    str: Parameter.Type.STRING_ARRAY,
}
_PYTHON_TYPES = {type_: python for table in (_SCALARS, _ELEMENTS) for python, type_ in table.items()}


def _field(type_: Any) -> str:
    """Return the name of the field of a ParameterValue for values of this type."""
    return f"{Parameter.Type(type_).name.lower()}_value"


def get_parameter_value(string_value: str) -> ParameterValue:
    """Convert a text to the value that it has in YAML; what no parameter can have becomes a string."""
    import yaml

    try:
        return _from_yaml(yaml.safe_load(string_value), string_value)
    except yaml.YAMLError:
        return _from_yaml(string_value, string_value)


def _from_yaml(value: Any, text: str) -> ParameterValue:
    """Convert the YAML value of a text, or the text itself if no parameter can have this value."""
    try:
        type_ = Parameter.Type.from_parameter_value(value)
    except TypeError:
        type_ = Parameter.Type.NOT_SET
    if value == []:
        # Not an array of bytes, which YAML cannot express.
        type_ = Parameter.Type.BOOL_ARRAY
    if type_ is Parameter.Type.NOT_SET:
        type_, value = Parameter.Type.STRING, text
    return ParameterValue(**{"type": type_.value, _field(type_): value})


def parameter_value_to_python(parameter_value: ParameterValue) -> Any:
    """Return a message's value: arrays as lists, `None` if not set. Raises RuntimeError for other types."""
    try:
        type_ = Parameter.Type(parameter_value.type)
    except ValueError:
        raise RuntimeError(f"unexpected parameter type {parameter_value.type}") from None
    if type_ is Parameter.Type.NOT_SET:
        return None
    value = getattr(parameter_value, _field(type_))
    return value if type_ in _SCALARS.values() else list(value)


def parameter_dict_from_yaml_file(
    parameter_file: str,
    use_wildcard: bool = False,
    target_nodes: list[str] | None = None,
    namespace: str = "",
) -> dict[str, ParameterMsg]:
    """Read the parameters of nodes from a YAML file, by name.

    :param use_wildcard: whether to include those of `/**`; those of nodes override them.
    :param target_nodes: names of nodes as in the file; all nodes if the list is empty.
    :param namespace: prefix of the names.
    :raises RuntimeError: if the file is not a parameter file or lacks a node.
    """
    import yaml

    with open(parameter_file, encoding="utf-8") as file:
        nodes = yaml.safe_load(file)
    if not isinstance(nodes, dict):
        raise RuntimeError(f"YAML file is not a valid ROS parameter file: {parameter_file}")
    selected = ["/**"] if use_wildcard and "/**" in nodes else []
    for node in target_nodes or []:
        if node not in nodes:
            raise RuntimeError(
                f"Param file does not contain parameters for {node}, only for nodes: {list(nodes)}"
            )
    selected += target_nodes or [node for node in nodes if node != "/**"]
    if not selected:
        raise RuntimeError("Param file does not contain selected parameters")

    parameters: dict[str, Any] = {}
    for node in selected:
        if not isinstance(nodes[node], dict) or "ros__parameters" not in nodes[node]:
            raise RuntimeError(f"YAML file is not a valid ROS parameter file for node {node}")
        parameters.update(nodes[node]["ros__parameters"] or {})
    return _flatten(namespace, parameters)


def _flatten(namespace: str, parameters: dict[str, Any]) -> dict[str, ParameterMsg]:
    messages: dict[str, ParameterMsg] = {}
    for key, value in parameters.items():
        name = f"{namespace}{key}"
        if isinstance(value, dict):
            messages.update(_flatten(name + PARAMETER_SEPARATOR_STRING, value))
        else:
            # As in rclpy, the text of the value decides its type, even if the value is in quotes.
            messages[name] = ParameterMsg(name=name, value=get_parameter_value(str(value)))
    return messages
