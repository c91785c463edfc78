from __future__ import annotations

from collections.abc import Iterator

import pytest
import rclpy.logging
from rclpy.logging import LoggingSeverity, get_logger


@pytest.fixture(autouse=True)
def fresh_configuration() -> Iterator[None]:
    rclpy.logging.clear_config()
    yield
    rclpy.logging.shutdown()


def test_a_logger_inherits_the_level_of_its_nearest_ancestor() -> None:
    rclpy.logging.set_logger_level("robot", LoggingSeverity.WARN)
    rclpy.logging.set_logger_level("robot.arm.motor", LoggingSeverity.DEBUG)
    effective = rclpy.logging.get_logger_effective_level
    assert effective("robot.arm") == LoggingSeverity.WARN
    assert effective("robot.arm.motor.left") == LoggingSeverity.DEBUG
    assert effective("robotic") == LoggingSeverity.INFO
    rclpy.logging.set_logger_level("robot", LoggingSeverity.UNSET)
    assert effective("robot.arm") == LoggingSeverity.INFO


def test_a_changed_level_takes_effect_at_once() -> None:
    logger = get_logger("changing")
    assert not logger.debug("before")
    logger.set_level(LoggingSeverity.DEBUG)
    assert logger.debug("after")
    logger.get_child("child").set_level(LoggingSeverity.FATAL)
    assert logger.get_child("child").get_effective_level() == LoggingSeverity.FATAL
    assert logger.get_effective_level() == LoggingSeverity.DEBUG


def test_the_level_of_the_empty_name_is_the_default() -> None:
    rclpy.logging.set_logger_level("", LoggingSeverity.ERROR)
    assert rclpy.logging.get_logger_level("") == LoggingSeverity.ERROR
    assert not get_logger("any").warning("omitted")
    assert rclpy.logging.get_logger_level("any") == LoggingSeverity.UNSET


def test_clear_config_resets_all_levels() -> None:
    rclpy.logging.set_logger_level("", LoggingSeverity.ERROR)
    rclpy.logging.set_logger_level("a", LoggingSeverity.DEBUG)
    rclpy.logging.clear_config()
    assert rclpy.logging.get_logger_effective_level("a") == LoggingSeverity.INFO


@pytest.mark.parametrize(("message", "shown"), [(None, "(null)"), (b"bytes", "bytes")])
def test_none_and_bytes_are_logged_as_strings(
    message: object, shown: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert get_logger("strings").error(message)  # type: ignore[arg-type]
    assert capfd.readouterr().err.rstrip().endswith(shown)
