from __future__ import annotations

from rclpy import exceptions
from rclpy.parameter import Parameter


def test_a_name_error_points_at_the_invalid_character() -> None:
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
        exceptions.ParameterImmutableException("a"): "Attempted to modify read-only parameter: a",
        exceptions.ParameterUninitializedException("a"): "The parameter 'a' is not initialized: a",
    }
    for error, text in texts.items():
        assert isinstance(error, exceptions.ParameterException)
        assert str(error) == text
    types = str(exceptions.InvalidParameterTypeException(Parameter("a", value=1), Parameter.Type.STRING))
    assert all(word in types for word in ("'a'", "'1'", "INTEGER", "STRING"))


def test_errors_before_init_and_after_shutdown_name_the_reason() -> None:
    assert str(exceptions.NotInitializedException()) == "rclpy.init() has not been called."
    assert str(exceptions.NotInitializedException("no node")) == (
        "rclpy.init() has not been called. msg:no node"
    )
    assert str(exceptions.ROSInterruptException()) == "rclpy.shutdown() has been called"
