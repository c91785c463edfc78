"""What the errors say."""

from __future__ import annotations

import pytest
from rclpy import exceptions
from rclpy.parameter import Parameter


def test_a_name_error_points_at_the_place() -> None:
    assert str(exceptions.InvalidNodeNameException("a?b", "bad character", 1)) == (
        "Invalid node name: bad character:\n  'a?b'\n    ^"
    )


def test_parameter_errors_name_the_parameters() -> None:
    texts = {
        exceptions.ParameterNotDeclaredException(["a", "b"]): (
            "Invalid access to undeclared parameter(s): ['a', 'b']"
        ),
        exceptions.ParameterAlreadyDeclaredException("a"): "Parameter(s) already declared: a",
        exceptions.InvalidParameterException(""): "Invalid parameter name: ",
        exceptions.InvalidParameterValueException("a", 1, "odd"): (
            "Invalid parameter value (1) for parameter. Reason: odd: a"
        ),
        exceptions.InvalidParameterTypeException(Parameter("a", value=1), Parameter.Type.STRING): (
            "Trying to set parameter 'a' to '1' of type 'INTEGER', expecting type 'STRING': a"
        ),
        exceptions.ParameterImmutableException("a"): "Attempted to modify read-only parameter: a",
        exceptions.ParameterUninitializedException("a"): "The parameter 'a' is not initialized: a",
    }
    for error, text in texts.items():
        assert isinstance(error, exceptions.ParameterException)
        assert str(error) == text


def test_using_rclpy_too_early_or_too_late_says_so() -> None:
    assert str(exceptions.NotInitializedException()) == "rclpy.init() has not been called."
    assert str(exceptions.NotInitializedException("no node")) == (
        "rclpy.init() has not been called. msg:no node"
    )
    assert str(exceptions.ROSInterruptException()) == "rclpy.shutdown() has been called"


@pytest.mark.parametrize(
    ("error", "base"),
    [
        (exceptions.InvalidHandle, RuntimeError),
        (exceptions.RCLInvalidROSArgsError, exceptions.RCLError),
        (exceptions.UnknownROSArgsError, RuntimeError),
        (exceptions.NodeNameNonExistentError, exceptions.RCLError),
        (exceptions.InvalidServiceNameException, exceptions.NameValidationException),
    ],
)
def test_errors_can_be_caught_by_their_bases(error: type[Exception], base: type[Exception]) -> None:
    assert issubclass(error, base)


def test_the_errors_of_the_c_extension_are_where_code_looks_for_them() -> None:
    from rclpy._rclpy_pybind11 import InvalidHandle, RCLError
    from rclpy.impl.implementation_singleton import rclpy_implementation

    assert RCLError is exceptions.RCLError
    assert rclpy_implementation.InvalidHandle is InvalidHandle is exceptions.InvalidHandle
    with pytest.raises(NotImplementedError, match=r"_rclpy_pybind11\.WaitSet"):
        _ = rclpy_implementation.WaitSet
    assert not hasattr(rclpy_implementation, "__path__")
