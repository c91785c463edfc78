from __future__ import annotations

from collections.abc import Iterator

import pytest

import rclpy.logging
from rclpy.clock import ROSClock
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.logging import LoggingSeverity, get_logger
from rclpy.time import Time


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


def test_only_the_named_severities_are_levels() -> None:
    assert rclpy.logging.get_logging_severity_from_string("warn") == LoggingSeverity.WARN
    assert rclpy.logging.get_logging_severity_from_string("FATAL") == LoggingSeverity.FATAL
    with pytest.raises(RuntimeError):
        rclpy.logging.get_logging_severity_from_string("loud")
    with pytest.raises(ValueError, match="25 is not a valid"):
        rclpy.logging.set_logger_level("a", 25)
    assert get_logger("a").is_enabled_for(LoggingSeverity.INFO)
    assert not get_logger("a").is_enabled_for(LoggingSeverity.DEBUG)


def test_a_child_logger_has_the_names_of_its_ancestors() -> None:
    assert get_logger("a").get_child("b").get_child("c").name == "a.b.c"
    assert RcutilsLogger().get_child("a").name == "a"
    for get in (get_logger, get_logger("a").get_child):
        with pytest.raises(ValueError, match="must not be empty"):
            get("")


def test_a_message_must_be_a_string() -> None:
    with pytest.raises(TypeError):
        get_logger("a").info(5)  # type: ignore[arg-type]


def test_an_unknown_option_is_an_error() -> None:
    with pytest.raises(TypeError, match="twice"):
        get_logger("a").info("hello", twice=True)
    with pytest.raises(TypeError, match="throttle_duration_sec"):
        get_logger("a").info("hello", throttle_time_source_type=ROSClock())
    with pytest.raises(ValueError, match="is not a clock instance"):
        get_logger("a").info("hello", throttle_duration_sec=1.0, throttle_time_source_type="wall")


def test_a_log_call_cannot_change_its_severity_name_or_filters() -> None:
    logger = get_logger("fickle")

    def log(severity: LoggingSeverity, **options: object) -> None:
        logger.log("hello", severity, **options)

    log(LoggingSeverity.INFO, once=True)
    with pytest.raises(ValueError, match="severity cannot be changed"):
        log(LoggingSeverity.WARN, once=True)
    with pytest.raises(ValueError, match="name cannot be changed"):
        log(LoggingSeverity.INFO, once=True, name="other")
    with pytest.raises(ValueError, match="Requested logging filters"):
        log(LoggingSeverity.INFO, skip_first=True)


def test_once_logs_only_the_first_message_of_a_call_site() -> None:
    logger = get_logger("once")
    assert [logger.info(str(i), once=True) for i in range(3)] == [True, False, False]
    assert logger.info("another call site", once=True)


def test_two_calls_on_one_line_are_two_call_sites() -> None:
    logger = get_logger("line")
    assert (logger.info("a", once=True), logger.info("b", once=True)) == (True, True)


def test_skip_first_omits_the_first_message_of_a_call_site() -> None:
    logger = get_logger("skip")
    assert [logger.info(str(i), skip_first=True) for i in range(3)] == [False, True, True]


def test_throttle_follows_the_given_clock(clock: ROSClock) -> None:
    logger = get_logger("throttle")
    logged = []
    for tenth in range(100, 125):
        clock.set_ros_time_override(Time(nanoseconds=tenth * 100_000_000))
        if logger.info("now", throttle_duration_sec=1.0, throttle_time_source_type=clock):
            logged.append(tenth)
    assert logged == [100, 110, 120]


def test_filters_apply_together_throttle_first(clock: ROSClock) -> None:
    logger = get_logger("both")
    logged = []
    for second in range(2, 8):
        clock.set_ros_time_override(Time(seconds=second))
        options = {"throttle_duration_sec": 2.0, "throttle_time_source_type": clock, "skip_first": True}
        if logger.info("now", **options):
            logged.append(second)
    assert logged == [4, 6]


def test_a_filtered_message_below_the_level_does_not_count() -> None:
    logger = get_logger("late")

    def log() -> bool:
        return logger.debug("hello", once=True)

    assert not log()
    logger.set_level(LoggingSeverity.DEBUG)
    assert log()


@pytest.mark.parametrize(("message", "shown"), [(None, "(null)"), (b"bytes", "bytes")])
def test_none_and_bytes_are_logged_as_strings(
    message: object, shown: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert get_logger("strings").error(message)  # type: ignore[arg-type]
    assert capfd.readouterr().err.rstrip().endswith(shown)
