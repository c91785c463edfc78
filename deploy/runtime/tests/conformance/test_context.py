"""Contexts, the default one above all: what init and shutdown leave behind."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

import rclpy
from rclpy.context import Context
from rclpy.logging import LoggingSeverity, clear_config, get_logger, get_logger_effective_level
from rclpy.signals import SignalHandlerOptions, get_current_signal_handlers_options
from rclpy.utilities import get_default_context


@pytest.fixture(autouse=True)
def _fresh_default_context(domain_id: int) -> Iterator[None]:
    rclpy.try_shutdown()
    yield
    rclpy.try_shutdown()
    rclpy.signals.uninstall_signal_handlers()


def test_what_is_to_run_at_shutdown_may_be_said_before_init() -> None:
    context = Context()
    called: list[str] = []
    context.on_shutdown(lambda: called.append("shutdown"))
    assert called == []
    context.init(args=[])
    assert called == []
    context.shutdown()
    assert called == ["shutdown"]
    context.on_shutdown(lambda: called.append("late"))
    assert called == ["shutdown", "late"]


def test_a_method_of_a_builtin_may_run_at_shutdown() -> None:
    context = Context()
    held = threading.Lock()
    held.acquire()
    context.on_shutdown(held.release)
    context.init(args=[])
    context.shutdown()
    assert not held.locked()


def test_a_method_that_is_to_run_at_shutdown_does_not_keep_its_object_alive() -> None:
    class Listener:
        def listen(self) -> None:
            raise AssertionError

    context = Context()
    context.on_shutdown(Listener().listen)
    context.init(args=[])
    context.shutdown()


def test_the_first_context_says_for_the_whole_process_how_to_log(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(rclpy.context, "g_logging_ref_count", 0)
    first, second, third = Context(), Context(), Context()
    try:
        first.init(args=["--ros-args", "--disable-stdout-logs", "--log-level", "error"])
        second.init(args=["--ros-args", "--log-level", "debug"])
        get_logger("quiet").error("this is not for the console")
        assert capfd.readouterr().err == ""
        assert get_logger_effective_level("quiet") == LoggingSeverity.ERROR
        first.shutdown()
        second.shutdown()
        third.init(args=["--ros-args", "--log-level", "debug"])
        get_logger("loud").debug("this is")
        assert "this is" in capfd.readouterr().err
    finally:
        for context in (first, second, third):
            context.try_shutdown()
        clear_config()


def test_init_returns_nothing_that_code_could_come_to_rely_on() -> None:
    assert rclpy.init(args=[]) is None  # type: ignore[func-returns-value]


def test_after_try_shutdown_rclpy_can_begin_anew_though_a_signal_had_shut_it_down() -> None:
    rclpy.init(args=[])
    get_default_context().shutdown()  # what a signal does
    rclpy.try_shutdown()
    rclpy.init(args=[])
    assert rclpy.ok()


def test_a_shutdown_of_the_default_context_handles_signals_no_more_however_it_was_named() -> None:
    rclpy.init(args=[])
    assert get_current_signal_handlers_options() == SignalHandlerOptions.ALL
    rclpy.shutdown(context=get_default_context())
    assert get_current_signal_handlers_options() == SignalHandlerOptions.NO


def test_a_shutdown_of_another_context_leaves_the_signal_handlers_alone() -> None:
    rclpy.init(args=[])
    context = Context()
    rclpy.init(args=[], context=context)
    rclpy.shutdown(context=context)
    assert get_current_signal_handlers_options() == SignalHandlerOptions.ALL
