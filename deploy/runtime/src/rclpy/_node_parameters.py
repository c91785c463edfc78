"""The part of `Node` that declares, sets and describes parameters."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

from rcl_interfaces.msg import (
    ListParametersResult,
    ParameterDescriptor,
    ParameterEvent,
    ParameterType,
    ParameterValue,
    SetParametersResult,
)
from rcl_interfaces.msg import Parameter as ParameterMsg
from rclpy._node_names import NodeNames
from rclpy._parameter_checks import objection
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterImmutableException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from rclpy.parameter import PARAMETER_SEPARATOR_STRING, Parameter, parameter_value_to_python
from rclpy.validate_parameter_name import validate_parameter_name

if TYPE_CHECKING:
    from rclpy.clock import Clock

_DEPTH_RECURSIVE = 0
"""`rcl_interfaces/srv/ListParameters`: list names of any depth."""


class NodeParameters(NodeNames):
    """Parameters by name, each with a descriptor, and the callbacks that check and observe changes.

    A node inherits from this class, calls `_rclpy_init_parameters` when its clock exists, and implements
    `_rclpy_publish_parameter_event`.
    """

    PARAM_REL_TOL = 1e-6
    """Relative tolerance with which a double must meet a bound or step of its range."""
    _clock: Clock

    def _rclpy_init_parameters(self, overrides: dict[str, Parameter], *, allow_undeclared: bool) -> None:
        """Begin without parameters; ``overrides`` replace the values that declarations give."""
        self._parameters: dict[str, Parameter] = {}
        self._descriptors: dict[str, ParameterDescriptor] = {}
        self._parameter_overrides = overrides
        self._allow_undeclared_parameters = allow_undeclared
        self._pre_set_parameters_callbacks: list[Callable[[list[Parameter]], list[Parameter]]] = []
        self._on_set_parameters_callbacks: list[Callable[[list[Parameter]], SetParametersResult]] = []
        self._post_set_parameters_callbacks: list[Callable[[list[Parameter]], None]] = []

    def _rclpy_declare_overrides(self) -> None:
        self.declare_parameters(
            "",
            [(p.name, p.value, ParameterDescriptor()) for p in self._parameter_overrides.values()],
            ignore_override=True,
        )

    def _rclpy_publish_parameter_event(self, event: ParameterEvent) -> None:
        raise NotImplementedError

    # Declaring

    def declare_parameter(
        self,
        name: str,
        value: Any = None,
        descriptor: ParameterDescriptor | None = None,
        ignore_override: bool = False,
    ) -> Parameter:
        """Declare a parameter and set it to its override, else to `value`.

        :param value: the default, or a `Parameter.Type` to leave the parameter uninitialized.
        :param descriptor: its name and type are ignored: they follow from `name` and the value.
        :param ignore_override: whether to set `value` even if there is an override.
        :returns: the declared parameter.
        :raises ParameterAlreadyDeclaredException: if it is already declared.
        :raises InvalidParameterException: if the name is invalid.
        :raises InvalidParameterTypeException: if the override is not of the declared type.
        :raises InvalidParameterValueException: if the descriptor or a callback rejects the value.
        """
        declaration: tuple[Any, ...] = (name,)
        if value is not None or descriptor is not None:
            declaration = (name, value, ParameterDescriptor() if descriptor is None else descriptor)
        return self.declare_parameters("", [declaration], ignore_override)[0]

    def declare_parameters(
        self,
        namespace: str,
        parameters: list[tuple[str] | tuple[str, Any] | tuple[str, Any, ParameterDescriptor]],
        ignore_override: bool = False,
    ) -> list[Parameter]:
        """Declare several parameters; see `declare_parameter`.

        :param namespace: prefix of all names, separated by a dot, unless it is empty.
        :param parameters: tuples of name, optionally value or type, and optionally descriptor.
        :raises TypeError: if a tuple does not have this form.
        """
        declared: list[tuple[Parameter, ParameterDescriptor]] = []
        for index, declaration in enumerate(parameters):
            name, value, descriptor = _unpack(index, declaration)
            name = f"{namespace}{PARAMETER_SEPARATOR_STRING}{name}" if namespace else name
            validate_parameter_name(name)
            if len(declaration) == 1:
                _warn_of_name_only(name)
                descriptor.dynamic_typing = True
            value = _default_value(name, value, descriptor)
            if not ignore_override and name in self._parameter_overrides:
                value = self._parameter_overrides[name].value
            declared.append((Parameter(name, value=value), descriptor))

        again = [parameter.name for parameter, _ in declared if parameter.name in self._parameters]
        if again:
            raise ParameterAlreadyDeclaredException(again)
        for parameter, descriptor in declared:
            self._rclpy_declare(parameter, descriptor)
        return [self._parameters[parameter.name] for parameter, _ in declared]

    def _rclpy_declare(self, parameter: Parameter, descriptor: ParameterDescriptor) -> None:
        result = self._rclpy_change([parameter], {parameter.name: descriptor}, keep_unset=True)
        if result.successful:
            return
        if result.reason.startswith("Wrong parameter type"):
            raise InvalidParameterTypeException(parameter, Parameter.Type(descriptor.type))
        raise InvalidParameterValueException(parameter.name, parameter.value, result.reason)

    def undeclare_parameter(self, name: str) -> None:
        """Remove a parameter, without callbacks and without an event.

        :raises ParameterNotDeclaredException: if it is not declared.
        :raises ParameterImmutableException: if it is read-only.
        """
        if not self.has_parameter(name):
            raise ParameterNotDeclaredException(name)
        if self._descriptors[name].read_only:
            raise ParameterImmutableException(name)
        del self._parameters[name]
        del self._descriptors[name]

    # Reading

    def has_parameter(self, name: str) -> bool:
        return name in self._parameters

    def get_parameter_types(self, names: list[str]) -> list[Parameter.Type]:
        """Return types, see `get_parameter_type`. Raises TypeError if a name is not a string."""
        _check_names(names)
        return [self.get_parameter_type(name) for name in names]

    def get_parameter_type(self, name: str) -> Parameter.Type:
        """Return the number of a parameter's type, as rclpy; NOT_SET if it need not be declared and is not.

        :raises ParameterNotDeclaredException: if it is not declared and must be.
        """
        if self.has_parameter(name):
            return cast("Parameter.Type", self._parameters[name].type_.value)
        if self._allow_undeclared_parameters:
            return Parameter.Type.NOT_SET
        raise ParameterNotDeclaredException(name)

    def get_parameters(self, names: list[str]) -> list[Parameter]:
        """Return parameters, see `get_parameter`. Raises TypeError if a name is not a string."""
        _check_names(names)
        return [self.get_parameter(name) for name in names]

    def get_parameter(self, name: str) -> Parameter:
        """Return a parameter. If it need not be declared and is not, its type is NOT_SET.

        :raises ParameterNotDeclaredException: if it is not declared and must be.
        :raises ParameterUninitializedException: if it was declared with a type only and never set.
        """
        parameter = self._parameters.get(name)
        if parameter is None:
            if self._allow_undeclared_parameters:
                return Parameter(name, Parameter.Type.NOT_SET, None)
            raise ParameterNotDeclaredException(name)
        if parameter.type_ is Parameter.Type.NOT_SET and not self._descriptors[name].dynamic_typing:
            raise ParameterUninitializedException(name)
        return parameter

    def get_parameter_or(self, name: str, alternative_value: Parameter | None = None) -> Parameter:
        """Return a parameter; if it has no value, the alternative (by default one of type NOT_SET)."""
        parameter = self._parameters.get(name)
        if parameter is None or parameter.type_ is Parameter.Type.NOT_SET:
            return Parameter(name, Parameter.Type.NOT_SET) if alternative_value is None else alternative_value
        return parameter

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Parameter]:
        """Return the `Parameter`s below `prefix`, by their names without it; all if `prefix` is empty."""
        start = f"{prefix}{PARAMETER_SEPARATOR_STRING}" if prefix else ""
        return {
            name.removeprefix(start): parameter
            for name, parameter in self._parameters.items()
            if name.startswith(start)
        }

    def list_parameters(self, prefixes: list[str], depth: int) -> ListParametersResult:
        """List the names of parameters, and their prefixes.

        :param prefixes: list parameters with or below these names; all parameters if the list is empty.
        :param depth: list names with fewer dots than this below the prefix; 0: all.
        :raises TypeError: if an argument is of the wrong type.
        :raises ValueError: if `depth` is negative.
        """
        if not isinstance(prefixes, list):
            raise TypeError("The prefixes argument must be a list")
        if not all(isinstance(prefix, str) for prefix in prefixes):
            raise TypeError("All prefixes must be instances of type str")
        if not isinstance(depth, int):
            raise TypeError("The depth must be instance of type int")
        if depth < 0:
            raise ValueError("The depth must be greater than or equal to zero")

        names = [name for name in self._parameters if _is_listed(name, prefixes, depth)]
        found = dict.fromkeys(name.rpartition(PARAMETER_SEPARATOR_STRING)[0] for name in names)
        return ListParametersResult(names=names, prefixes=[prefix for prefix in found if prefix])

    # Setting

    def set_parameters(self, parameter_list: list[Parameter]) -> list[SetParametersResult]:
        """Set parameters one by one; setting a parameter to NOT_SET undeclares it.

        :returns: for each, whether it was set, and the reason if not.
        :raises ParameterNotDeclaredException: for the first parameter that is not declared and must be; the
            ones before it stay set.
        """
        return [self._set_parameters_atomically([parameter]) for parameter in parameter_list]

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set all parameters or none; setting a parameter to NOT_SET undeclares it.

        :returns: whether they were set, and the reason if not.
        :raises ParameterNotDeclaredException: if a parameter is not declared and must be.
        """
        return self._set_parameters_atomically(parameter_list)

    def _set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        if self._pre_set_parameters_callbacks:
            given = parameter_list
            parameter_list = [
                parameter for callback in self._pre_set_parameters_callbacks for parameter in callback(given)
            ]
            if not parameter_list:
                return SetParametersResult(
                    successful=False,
                    reason="parameter list cannot be empty, this might be due to pre_set_parameters_callback "
                    "modifying the original parameters list.",
                )
        if not all(isinstance(parameter, Parameter) for parameter in parameter_list):
            raise TypeError(f"parameter must be instance of type '{Parameter!r}'")
        undeclared = [
            parameter.name for parameter in parameter_list if not self.has_parameter(parameter.name)
        ]
        if undeclared and not self._allow_undeclared_parameters:
            raise ParameterNotDeclaredException(undeclared)
        return self._rclpy_change(parameter_list)

    def _rclpy_change(
        self,
        parameters: list[Parameter],
        descriptors: dict[str, ParameterDescriptor] | None = None,
        keep_unset: bool = False,
    ) -> SetParametersResult:
        """Check the values, ask the callbacks, set the parameters, publish the event, notify the callbacks.

        :param descriptors: new descriptors of all parameters; `None`: their current ones.
        :param keep_unset: whether to store parameters that are not set, instead of undeclaring them.
        """
        for parameter in parameters:
            descriptor = (descriptors or self._descriptors).get(parameter.name)
            reason = self._rclpy_objection(parameter, descriptor, new=descriptors is not None)
            if reason:
                return SetParametersResult(successful=False, reason=reason)
        # A copy, since a callback may remove itself.
        for callback in list(self._on_set_parameters_callbacks):
            result = callback(parameters)
            if not result.successful:
                return result
        event = ParameterEvent(node=self.get_fully_qualified_name())
        for parameter in parameters:
            if parameter.type_ is Parameter.Type.NOT_SET and not keep_unset:
                event.deleted_parameters.append(parameter.to_parameter_msg())
                self._parameters.pop(parameter.name, None)
                self._descriptors.pop(parameter.name, None)
                continue
            is_new = self.get_parameter_or(parameter.name).type_ is Parameter.Type.NOT_SET
            (event.new_parameters if is_new else event.changed_parameters).append(
                parameter.to_parameter_msg()
            )
            self._rclpy_store(parameter, descriptors[parameter.name] if descriptors else None)
        event.stamp = self._clock.now().to_msg()
        self._rclpy_publish_parameter_event(event)
        for notify in list(self._post_set_parameters_callbacks):
            notify(parameters)
        return SetParametersResult(successful=True)

    def _rclpy_objection(
        self, parameter: Parameter, descriptor: ParameterDescriptor | None, *, new: bool
    ) -> str:
        """Return why a parameter cannot be set; '' if it can. A `new` descriptor may be read-only."""
        if descriptor is None:
            return ""
        if descriptor.read_only and not new:
            return f"Trying to set a read-only parameter: {parameter.name}."
        unset = parameter.type_ is Parameter.Type.NOT_SET
        if unset and not descriptor.dynamic_typing and self.has_parameter(parameter.name):
            return "Static parameter cannot be undeclared"
        return objection(parameter, descriptor, self.PARAM_REL_TOL)

    def _rclpy_store(self, parameter: Parameter, descriptor: ParameterDescriptor | None) -> None:
        """Set a parameter that passed all checks; without a descriptor, it is dynamically typed."""
        if descriptor is None:
            descriptor = self._descriptors.get(parameter.name) or ParameterDescriptor(dynamic_typing=True)
        descriptor.name = parameter.name
        if descriptor.dynamic_typing:
            descriptor.type = parameter.type_.value
        self._descriptors[parameter.name] = descriptor
        self._parameters[parameter.name] = parameter

    # Callbacks

    def add_pre_set_parameters_callback(self, callback: Callable[[list[Parameter]], list[Parameter]]) -> None:
        """Let `callback` replace the parameters before they are checked; the last added is called first."""
        self._pre_set_parameters_callbacks.insert(0, callback)

    def add_on_set_parameters_callback(
        self, callback: Callable[[list[Parameter]], SetParametersResult]
    ) -> None:
        """Let `callback` accept or reject new values of parameters; the last added is called first."""
        self._on_set_parameters_callbacks.insert(0, callback)

    def add_post_set_parameters_callback(self, callback: Callable[[list[Parameter]], None]) -> None:
        """Call `callback` after parameters were declared or set; the last added is called first."""
        self._post_set_parameters_callbacks.insert(0, callback)

    def remove_pre_set_parameters_callback(
        self, callback: Callable[[list[Parameter]], list[Parameter]]
    ) -> None:
        """Undo `add_pre_set_parameters_callback`; ValueError if it was not added."""
        self._pre_set_parameters_callbacks.remove(callback)

    def remove_on_set_parameters_callback(
        self, callback: Callable[[list[Parameter]], SetParametersResult]
    ) -> None:
        """Undo `add_on_set_parameters_callback`; ValueError if it was not added."""
        self._on_set_parameters_callbacks.remove(callback)

    def remove_post_set_parameters_callback(self, callback: Callable[[list[Parameter]], None]) -> None:
        """Undo `add_post_set_parameters_callback`; ValueError if it was not added."""
        self._post_set_parameters_callbacks.remove(callback)

    # Describing

    def describe_parameter(self, name: str) -> ParameterDescriptor:
        """Return the descriptor of a parameter; an empty one if it need not be declared and is not.

        :raises ParameterNotDeclaredException: if it is not declared and must be.
        """
        descriptor = self._descriptors.get(name)
        if descriptor is not None:
            return descriptor
        if self._allow_undeclared_parameters:
            return ParameterDescriptor()
        raise ParameterNotDeclaredException(name)

    def describe_parameters(self, names: list[str]) -> list[ParameterDescriptor]:
        """Return the descriptors of parameters; see `describe_parameter`."""
        return [self.describe_parameter(name) for name in names]

    def set_descriptor(
        self,
        name: str,
        descriptor: ParameterDescriptor,
        alternative_value: ParameterValue | None = None,
    ) -> ParameterValue:
        """Replace the descriptor of a parameter; set the alternative value if it rejects the current value.

        :returns: the new value of the parameter.
        :raises ParameterNotDeclaredException: if it is not declared and must be.
        :raises ParameterImmutableException: if it is read-only.
        :raises InvalidParameterValueException: if the descriptor rejects both values.
        """
        if not self.has_parameter(name):
            return self.get_parameter(name).get_parameter_value()
        if self.describe_parameter(name).read_only:
            raise ParameterImmutableException(name)

        parameter = self.get_parameter(name)
        descriptor = copy.copy(descriptor)
        reason = self._rclpy_objection(parameter, descriptor, new=True)
        if reason and alternative_value is not None:
            parameter = Parameter.from_parameter_msg(ParameterMsg(name=name, value=alternative_value))
            reason = self._rclpy_objection(parameter, descriptor, new=True)
        if reason:
            raise InvalidParameterValueException(name, parameter.value, reason)
        self._rclpy_store(parameter, descriptor)
        return parameter.get_parameter_value()


def _unpack(index: int, declaration: tuple[Any, ...]) -> tuple[str, Any, ParameterDescriptor]:
    """Return name, value and a copy of the descriptor of a declaration."""
    if not 1 <= len(declaration) <= 3:
        raise TypeError(
            f"Invalid parameter tuple length at index {index} in parameters list: {declaration}; "
            "expecting length between 1 and 3"
        )
    name, value, descriptor = (*declaration, None, None)[:3]
    if not isinstance(name, str):
        raise TypeError(f"First element {name} at index {index} in parameters list is not a str.")
    if len(declaration) < 3:
        descriptor = ParameterDescriptor()
    if not isinstance(descriptor, ParameterDescriptor):
        raise TypeError(
            f"Third element {descriptor} at index {index} in parameters list is not a ParameterDescriptor."
        )
    # The caller may use the descriptor for other parameters, too.
    return name, value, copy.copy(descriptor)


def _default_value(name: str, value: Any, descriptor: ParameterDescriptor) -> Any:
    """Return the value of a declaration, `None` if it is a type; set the descriptor's type."""
    if isinstance(value, Parameter.Type):
        if value is Parameter.Type.NOT_SET:
            raise ValueError(f"Cannot declare parameter {{{name}}} as statically typed of type NOT_SET")
        if descriptor.dynamic_typing:
            raise ValueError(
                f"When declaring parameter {{{name}}} passing a descriptor with `dynamic_typing=True` "
                "is not allowed when the parameter type is provided"
            )
        descriptor.type = value.value
        return None
    if isinstance(value, ParameterValue):
        value = parameter_value_to_python(value)
    if not descriptor.dynamic_typing:
        descriptor.type = Parameter.Type.from_parameter_value(value).value
        if descriptor.type == ParameterType.PARAMETER_NOT_SET:
            raise ValueError(
                "Cannot declare a statically typed parameter with default value of type PARAMETER_NOT_SET"
            )
    return value


def _warn_of_name_only(name: str) -> None:
    warnings.warn(
        f"when declaring parameter named '{name}', declaring a parameter only providing its name is "
        "deprecated. You have to either:\n"
        '\t- Pass a name and a default value different to "PARAMETER NOT SET"'
        " (and optionally a descriptor).\n"
        "\t- Pass a name and a parameter type.\n"
        "\t- Pass a name and a descriptor with `dynamic_typing=True",
        stacklevel=4,
    )


def _check_names(names: list[str]) -> None:
    if not all(isinstance(name, str) for name in names):
        raise TypeError("All names must be instances of type str")


def _is_listed(name: str, prefixes: list[str], depth: int) -> bool:
    def is_shallow(rest: str) -> bool:
        return depth == _DEPTH_RECURSIVE or rest.count(PARAMETER_SEPARATOR_STRING) < depth

    if not prefixes:
        return is_shallow(name)
    for prefix in prefixes:
        below = f"{prefix}{PARAMETER_SEPARATOR_STRING}"
        if name == prefix or (name.startswith(below) and is_shallow(name.removeprefix(below))):
            return True
    return False
