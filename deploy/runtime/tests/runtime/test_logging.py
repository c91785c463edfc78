from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import rclpy.logging
from rclpy.impl import _logging_output
from rclpy.impl._logging_output import LogRecord
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.logging import LoggingSeverity, get_logger

ENVIRONMENT = (
    "RCUTILS_CONSOLE_OUTPUT_FORMAT",
    "RCUTILS_COLORIZED_OUTPUT",
    "RCUTILS_LOGGING_USE_STDOUT",
    "RCUTILS_LOGGING_BUFFERED_STREAM",
)


@pytest.fixture(autouse=True)
def fresh_configuration(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for variable in ENVIRONMENT:
        monkeypatch.delenv(variable, raising=False)
    rclpy.logging.clear_config()
    yield
    rclpy.logging.shutdown()


def configure(monkeypatch: pytest.MonkeyPatch, **environment: str) -> None:
    for variable, value in environment.items():
        monkeypatch.setenv(variable, value)
    rclpy.logging.clear_config()


# Levels


def test_messages_below_info_are_omitted_by_default(capsys: pytest.CaptureFixture[str]) -> None:
    logger = get_logger("quiet")
    assert logger.debug("not this") is False
    assert logger.info("this") is True
    assert "this" in capsys.readouterr().err


# Messages


def test_each_severity_has_a_method(capsys: pytest.CaptureFixture[str]) -> None:
    logger = get_logger("speaker")
    logger.set_level(LoggingSeverity.DEBUG)
    assert logger.debug("hello")
    assert logger.info("hello")
    assert logger.warn("hello")
    assert logger.warning("hello")
    assert logger.error("hello")
    assert logger.fatal("hello")
    lines = capsys.readouterr().err.splitlines()
    assert [line.split("]")[0][1:] for line in lines] == ["DEBUG", "INFO", "WARN", "WARN", "ERROR", "FATAL"]
    assert all(line.endswith("[speaker]: hello") for line in lines)


def test_a_message_may_be_logged_under_another_name(capsys: pytest.CaptureFixture[str]) -> None:
    get_logger("me").info("hello", name="you")
    assert "[you]: hello" in capsys.readouterr().err


# Filters


def test_throttle_does_not_follow_the_wall_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    logger = get_logger("steady")
    steady = 0
    monkeypatch.setattr("rclpy.impl.rcutils_logger.time.monotonic_ns", lambda: steady)
    logged = []
    for steady in (0, 999_999_999, 1_000_000_000, 1_500_000_000, 2_000_000_000):
        if logger.info("now", throttle_duration_sec=1.0):
            logged.append(steady)
    assert logged == [0, 1_000_000_000, 2_000_000_000]


# The console


def test_the_default_format_is_that_of_ros(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("rclpy.impl.rcutils_logger.time.time_ns", lambda: 1_600_000_000_000_000_042)
    get_logger("node.child").warning("careful")
    assert capsys.readouterr().err == "[WARN] [1600000000.000000042] [node.child]: careful\n"


def test_the_format_may_contain_every_token_and_escape(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    configure(
        monkeypatch,
        RCUTILS_CONSOLE_OUTPUT_FORMAT=r"{severity}\t{name}|{message}|{function_name}|{line_number}|"
        r"{time_as_nanoseconds}|{unknown}|{|\x1b[1m\q",
    )
    monkeypatch.setattr("rclpy.impl.rcutils_logger.time.time_ns", lambda: 42)
    get_logger("n").info("m {name}")
    line = sys._getframe().f_lineno - 1
    assert capsys.readouterr().err == (
        "INFO\tn|m {name}|test_the_format_may_contain_every_token_and_escape|"
        f"{line}|0000000000000000042|{{unknown}}|{{|\x1b[1m\\q\n"
    )


def test_a_child_logger_reports_the_file_of_its_caller(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    configure(monkeypatch, RCUTILS_CONSOLE_OUTPUT_FORMAT="{file_name}")
    get_logger("n").get_child("c").warn("m")
    assert capsys.readouterr().err == f"{__file__}\n"


def test_the_date_is_local_with_milliseconds(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    configure(monkeypatch, RCUTILS_CONSOLE_OUTPUT_FORMAT="{date_time_with_ms}", TZ="UTC")
    import time

    time.tzset()
    monkeypatch.setattr("rclpy.impl.rcutils_logger.time.time_ns", lambda: 1_600_000_000_007_000_000)
    get_logger("n").info("m")
    monkeypatch.delenv("TZ")
    time.tzset()
    assert capsys.readouterr().err == "2020-09-13 12:26:40.007\n"


def test_forced_colors_follow_the_severity(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    configure(monkeypatch, RCUTILS_COLORIZED_OUTPUT="1", RCUTILS_CONSOLE_OUTPUT_FORMAT="{message}")
    logger = get_logger("painter")
    logger.set_level(LoggingSeverity.DEBUG)
    logger.debug("m")
    logger.info("m")
    logger.warning("m")
    logger.error("m")
    logger.fatal("m")
    colors = [line.removesuffix("m\033[0m") for line in capsys.readouterr().err.splitlines()]
    assert colors == ["\033[32m", "\033[0m", "\033[33m", "\033[31m", "\033[31m"]


def test_a_file_gets_no_colors(capsys: pytest.CaptureFixture[str]) -> None:
    get_logger("plain").error("m")
    assert "\033" not in capsys.readouterr().err


def test_the_environment_can_send_messages_to_stdout(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    configure(monkeypatch, RCUTILS_LOGGING_USE_STDOUT="1", RCUTILS_LOGGING_BUFFERED_STREAM="1")
    get_logger("out").info("hello")
    captured = capsys.readouterr()
    assert "hello" in captured.out
    assert captured.err == ""


@pytest.mark.parametrize("variable", ENVIRONMENT[1:])
def test_an_error_names_the_wrong_environment_variable(
    monkeypatch: pytest.MonkeyPatch, variable: str
) -> None:
    with pytest.raises(RuntimeError, match=rf"\[yes\] specified for {variable}"):
        configure(monkeypatch, **{variable: "yes"})
    monkeypatch.delenv(variable)


def test_a_wrong_environment_variable_does_not_prevent_logging(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rclpy.logging.shutdown()
    monkeypatch.setenv("RCUTILS_COLORIZED_OUTPUT", "yes")
    get_logger("n").info("hello")
    error = capsys.readouterr().err
    assert "RCUTILS_COLORIZED_OUTPUT" in error
    assert "[n]: hello" in error


def test_logging_to_a_closed_console_is_no_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    stream = (tmp_path / "console").open("w")
    stream.close()
    monkeypatch.setattr(sys, "stderr", stream)
    assert get_logger("n").info("hello")
    monkeypatch.setattr(sys, "stderr", None)
    assert get_logger("n").info("hello")


def test_characters_that_the_console_cannot_show_are_escaped(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = tmp_path / "console"
    with path.open("w", encoding="ascii") as stream:
        monkeypatch.setattr(sys, "stderr", stream)
        get_logger("n").info("θ")
    assert path.read_text("ascii").endswith("[n]: \\u03b8\n")


# /rosout


@pytest.fixture
def records() -> Iterator[list[LogRecord]]:
    """What the publisher of the logger ``node`` gets."""
    records: list[LogRecord] = []
    _logging_output.add_rosout_publisher("node", records.append)
    yield records
    _logging_output.remove_rosout_publisher(records.append)


def test_messages_of_a_node_and_its_children_reach_rosout(records: list[LogRecord]) -> None:
    logger = get_logger("node")
    child = logger.get_child("child")
    logger.info("a")
    child.warning("b")
    get_logger("node.stranger").info("c")
    get_logger("other").info("d")
    logger.debug("e")
    _logging_output.remove_rosout_publisher(records.append)
    child.info("f")
    assert [(record.name, record.level, record.message) for record in records] == [
        ("node", 20, "a"),
        ("node.child", 30, "b"),
    ]
    assert records[0].file == __file__
    assert records[0].function == "test_messages_of_a_node_and_its_children_reach_rosout"


def test_a_deleted_child_logger_is_forgotten(records: list[LogRecord]) -> None:
    child, same = get_logger("node").get_child("child"), get_logger("node").get_child("child")
    del child
    get_logger("node.child").info("still there")
    del same
    get_logger("node.child").info("gone")
    assert [record.message for record in records] == ["still there"]
    assert set(_logging_output._rosout) == {"node"}
    _logging_output.remove_rosout_publisher(records.append)
    assert not _logging_output._rosout


def test_a_child_logger_may_be_collected_during_remove_rosout_publisher() -> None:
    class Publisher:
        def __call__(self, record: LogRecord) -> None:
            raise AssertionError

        def __eq__(self, other: object) -> bool:  # the garbage collector may run here
            children.clear()
            return self is other

        __hash__ = None  # type: ignore[assignment]

    children: list[RcutilsLogger] = []
    publisher, other = Publisher(), Publisher()
    _logging_output.add_rosout_publisher("node", other)
    _logging_output.add_rosout_publisher("parent", publisher)
    children.append(get_logger("parent").get_child("child"))
    _logging_output.remove_rosout_publisher(publisher)
    assert _logging_output._rosout == {"node": [other]}
    _logging_output.remove_rosout_publisher(other)
    assert _logging_output._rosout == {}


def test_a_rosout_publisher_may_log_and_fail(capsys: pytest.CaptureFixture[str]) -> None:
    def publish(record: LogRecord) -> None:
        get_logger("node").error("in publish")
        raise RuntimeError("no network")

    _logging_output.add_rosout_publisher("node", publish)
    try:
        assert get_logger("node").info("hello")
    finally:
        _logging_output.remove_rosout_publisher(publish)
    error = capsys.readouterr().err
    assert error.count("in publish") == 1
    assert "no network" in error


def test_rosout_works_without_the_console(
    records: list[LogRecord], capsys: pytest.CaptureFixture[str]
) -> None:
    _logging_output.enable_console(False)
    try:
        get_logger("node").info("hello")
    finally:
        _logging_output.enable_console(True)
    assert capsys.readouterr().err == ""
    assert len(records) == 1


def test_lines_of_concurrent_threads_do_not_mix(capsys: pytest.CaptureFixture[str]) -> None:
    def log(name: str) -> None:
        logger = get_logger(name)
        for i in range(200):
            logger.info(f"{name} {i}")

    threads = [threading.Thread(target=log, args=(f"thread{i}",)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 800
    assert all(line.startswith("[INFO] [") for line in lines)


def test_a_wrapper_can_hide_itself_as_in_rclpy(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from rclpy.impl import rcutils_logger

    configure(monkeypatch, RCUTILS_CONSOLE_OUTPUT_FORMAT="{function_name}")
    wrapper: dict[str, object] = {}
    exec(compile("def wrapper(log):\n    log('hello')", "/opt/wrapper.py", "exec"), wrapper)
    monkeypatch.setattr(
        rcutils_logger, "_internal_callers", [*rcutils_logger._internal_callers, "/opt/wrapper.py"]
    )
    wrapper["wrapper"](get_logger("n").info)  # type: ignore[operator]
    assert capsys.readouterr().err == "test_a_wrapper_can_hide_itself_as_in_rclpy\n"


@pytest.mark.parametrize(
    ("environment", "directory"),
    [
        ({"HOME": "/home/me"}, "/home/me/.ros/log"),
        ({"HOME": "/home/me", "ROS_HOME": "/srv/ros"}, "/srv/ros/log"),
        ({"HOME": "/home/me", "ROS_LOG_DIR": "~/logs", "ROS_HOME": "/srv/ros"}, "/home/me/logs"),
    ],
)
def test_the_logging_directory_is_that_of_ros(
    monkeypatch: pytest.MonkeyPatch, environment: dict[str, str], directory: str
) -> None:
    for variable in ("ROS_LOG_DIR", "ROS_HOME"):
        monkeypatch.delenv(variable, raising=False)
    for variable, value in environment.items():
        monkeypatch.setenv(variable, value)
    assert rclpy.logging.get_logging_directory() == Path(directory)
