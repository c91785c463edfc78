"""The errors of rclpy's C extension: base classes and import paths."""

from __future__ import annotations

import pytest

from rclpy import exceptions


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


def test_errors_of_the_c_extension_have_the_import_paths_of_rclpy() -> None:
    from rclpy._rclpy_pybind11 import InvalidHandle, RCLError
    from rclpy.impl.implementation_singleton import rclpy_implementation

    assert RCLError is exceptions.RCLError
    assert rclpy_implementation.InvalidHandle is InvalidHandle is exceptions.InvalidHandle
    with pytest.raises(NotImplementedError, match=r"_rclpy_pybind11\.WaitSet"):
        _ = rclpy_implementation.WaitSet
    assert not hasattr(rclpy_implementation, "__path__")
