from __future__ import annotations

from collections.abc import Iterator

import pytest
import rclpy
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import LoggingSeverity, clear_config, get_logger, get_logger_effective_level
from rclpy.signals import SignalHandlerOptions, get_current_signal_handlers_options
from rclpy.utilities import get_default_context


@pytest.fixture(autouse=True)
def _fresh_default_context(domain_id: int) -> Iterator[None]:
    rclpy.try_shutdown()
    yield
    rclpy.try_shutdown()
    rclpy.signals.uninstall_signal_handlers()


def test_the_first_context_configures_logging_for_the_process(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(rclpy.context, "g_logging_ref_count", 0)
    first, second, third = Context(), Context(), Context()
    try:
        first.init(args=["--ros-args", "--disable-stdout-logs", "--log-level", "error"])
        second.init(args=["--ros-args", "--log-level", "debug"])
        get_logger("quiet").error("not on the console")
        assert capfd.readouterr().err == ""
        assert get_logger_effective_level("quiet") == LoggingSeverity.ERROR
        first.shutdown()
        second.shutdown()
        third.init(args=["--ros-args", "--log-level", "debug"])
        get_logger("loud").debug("on the console")
        assert "on the console" in capfd.readouterr().err
    finally:
        for context in (first, second, third):
            context.try_shutdown()
        clear_config()


def test_after_a_signal_and_try_shutdown_init_works_again() -> None:
    rclpy.init(args=[])
    get_default_context().shutdown()  # as a signal does
    rclpy.try_shutdown()
    rclpy.init(args=[])
    assert rclpy.ok()


def test_shutdown_after_a_signal_says_that_it_is_the_second() -> None:
    context = Context()
    rclpy.init(context=context)
    context.shutdown()  # as a signal does
    with pytest.raises(rclpy_implementation.RCLError, match="already called"):
        rclpy.shutdown(context=context)


def test_shutdown_of_the_default_context_removes_the_signal_handlers() -> None:
    rclpy.init(args=[])
    assert get_current_signal_handlers_options() == SignalHandlerOptions.ALL
    rclpy.shutdown(context=get_default_context())
    assert get_current_signal_handlers_options() == SignalHandlerOptions.NO


def test_shutdown_of_another_context_keeps_the_signal_handlers() -> None:
    rclpy.init(args=[])
    context = Context()
    rclpy.init(args=[], context=context)
    rclpy.shutdown(context=context)
    assert get_current_signal_handlers_options() == SignalHandlerOptions.ALL
