"""The exceptions of rclpy."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.parameter import AllowableParameterValue


class InvalidHandle(RuntimeError):
    """Raised when an entity is used after it was destroyed."""


class RCUtilsError(RuntimeError):
    """Raised when a utility that rclpy shares with C fails."""


class RMWError(RuntimeError):
    """Raised when the middleware rejects a request."""


class RCLError(RuntimeError):
    """Raised when the core library rejects a request."""


class RCLInvalidROSArgsError(RCLError):
    """Raised when an argument between `--ros-args` and `--` is invalid."""


class UnknownROSArgsError(RuntimeError):
    """Raised when a flag between `--ros-args` and `--` is unknown."""


class NodeNameNonExistentError(RCLError):
    """Raised when a query names a node that is not in the graph."""


class UnsupportedEventTypeError(RCLError):
    """Raised when the middleware cannot report an event."""


class NotInitializedException(Exception):
    """Raised when rclpy is used before `rclpy.init()` or after `rclpy.shutdown()`."""

    def __init__(self, message: str | None = None) -> None:
        text = "rclpy.init() has not been called"
        super().__init__(f"{text}. msg:{message}" if message else f"{text}.")


class NoTypeSupportImportedException(Exception):
    """Raised when a class is used as a message type but is not one."""

    def __init__(self) -> None:
        super().__init__("no type_support imported")


class NameValidationException(Exception):
    """Raised when a topic, service, node or namespace name is invalid; the message marks the place."""

    def __init__(self, name_type: str, name: str, error_msg: str, invalid_index: int) -> None:
        super().__init__(f"Invalid {name_type}: {error_msg}:\n  '{name}'\n   {' ' * invalid_index}^")


class InvalidNamespaceException(NameValidationException):
    def __init__(self, name: str, error_msg: str, invalid_index: int) -> None:
        super().__init__("namespace", name, error_msg, invalid_index)


class InvalidNodeNameException(NameValidationException):
    """Raised when a node name is invalid."""

    def __init__(self, name: str, error_msg: str, invalid_index: int) -> None:
        super().__init__("node name", name, error_msg, invalid_index)


class InvalidTopicNameException(NameValidationException):
    """Raised when a topic name is invalid."""

    def __init__(self, name: str, error_msg: str, invalid_index: int) -> None:
        super().__init__("topic name", name, error_msg, invalid_index)


class InvalidServiceNameException(NameValidationException):
    """Raised when a service name is invalid."""

    def __init__(self, name: str, error_msg: str, invalid_index: int) -> None:
        super().__init__("service name", name, error_msg, invalid_index)


class ParameterException(Exception):
    """Base of all errors about parameters; the message ends with their names."""

    def __init__(self, error_msg: str, parameters: str | list[str]) -> None:
        super().__init__(f"{error_msg}: {parameters}")


class ParameterNotDeclaredException(ParameterException):
    """Raised when a parameter is not declared and the node does not allow undeclared parameters."""

    def __init__(self, parameters: str | list[str]) -> None:
        super().__init__("Invalid access to undeclared parameter(s)", parameters)


class ParameterAlreadyDeclaredException(ParameterException):
    """Raised when a parameter is declared twice."""

    def __init__(self, parameters: str | list[str]) -> None:
        super().__init__("Parameter(s) already declared", parameters)


class InvalidParameterException(ParameterException):
    """Raised when a parameter is declared with an invalid name."""

    def __init__(self, parameter_name: str):
        super().__init__("Invalid parameter name", parameter_name)


class InvalidParameterTypeException(ParameterException):
    """Raised when the value of a parameter does not have its declared type."""

    from rclpy.parameter import Parameter

    def __init__(self, desired_parameter: Parameter, expected_type: Parameter.Type) -> None:
        super().__init__(
            f"Trying to set parameter '{desired_parameter.name}' to '{desired_parameter.value}' of type "
            f"'{desired_parameter.type_.name}', expecting type '{expected_type.name}'",
            desired_parameter.name,
        )


class InvalidParameterValueException(ParameterException):
    """Raised when the descriptor or a callback rejects the value of a parameter."""

    def __init__(self, parameter: str, value: AllowableParameterValue, reason: str) -> None:
        super().__init__(f"Invalid parameter value ({value}) for parameter. Reason: {reason}", parameter)


class ParameterImmutableException(ParameterException):
    """Raised when a read-only parameter is changed."""

    def __init__(self, parameter_name: str):
        super().__init__("Attempted to modify read-only parameter", parameter_name)


class ParameterUninitializedException(ParameterException):
    """Raised when a parameter that was declared with a type only is read before it is set."""

    def __init__(self, parameter_name: str):
        super().__init__(f"The parameter '{parameter_name}' is not initialized", parameter_name)


class ROSInterruptException(Exception):
    """Raised when a sleep ends because rclpy shuts down."""

    def __init__(self) -> None:
        super().__init__("rclpy.shutdown() has been called")
