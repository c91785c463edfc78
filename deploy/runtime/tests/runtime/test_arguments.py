"""The command line: remapping, parameters, parameter files, logging and errors."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import rclpy.logging
from rclpy._arguments import RosArguments, parse, remove_ros_args
from rclpy._parameter_files import ParameterFileError, read_parameter_file
from rclpy._parameter_values import parse_value
from rclpy.exceptions import RCLInvalidROSArgsError, UnknownROSArgsError
from rclpy.logging import LoggingSeverity
from rclpy.parameter import Parameter


def ros(*arguments: str) -> RosArguments:
    return parse(["program", "--ros-args", *arguments])


def values(arguments: RosArguments, fqn: str) -> dict[str, Any]:
    return {name: parameter.value for name, parameter in arguments.parameter_overrides(fqn).items()}


# ROS arguments among others


def test_ros_arguments_stand_between_their_flag_and_two_dashes() -> None:
    argv = ["program", "-r", "x", "--ros-args", "-r", "a:=b", "--", "rest", "--ros-args", "-p", "c:=1"]
    arguments = parse(argv)
    assert arguments.remaining == ["program", "-r", "x", "rest"]
    assert remove_ros_args(argv) == arguments.remaining
    assert arguments.remap_topic("/a", "n", "/") == "/b"
    assert values(arguments, "/n") == {"c": 1}


def test_an_empty_list_means_no_arguments_and_none_means_sys_argv(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["program", "--ros-args", "-r", "__node:=other"])
    assert parse([]) == RosArguments(parameters=({},))
    assert parse(None).node_name("n", "/") == ("other", "/")
    assert remove_ros_args(None) == ["program"]


def test_a_remap_outside_of_ros_args_works_and_warns(
    capsys: pytest.CaptureFixture[str],
) -> None:
    arguments = parse(["program", "a:=b", "--x:=y"])
    assert arguments.remap_topic("/a", "n", "/") == "/b"
    assert arguments.remaining == ["program", "--x:=y"]
    assert "This syntax is deprecated" in capsys.readouterr().err


def test_an_error_names_all_unknown_ros_arguments() -> None:
    with pytest.raises(UnknownROSArgsError, match=r"\['--foo', 'bar'\]"):
        ros("--foo", "bar", "-p", "a:=1")


@pytest.mark.parametrize("flag", ["-r", "--remap", "-p", "--param", "--params-file", "--log-level", "-e"])
def test_a_flag_without_its_value_is_an_error(flag: str) -> None:
    with pytest.raises(RCLInvalidROSArgsError, match=f"{flag} needs a value"):
        ros(flag)


def test_log_file_options_are_refused_by_name() -> None:
    for flag in ("--log-config-file", "--log-file-name"):
        with pytest.raises(NotImplementedError, match=flag):
            ros(flag, "x")


def test_an_enclave_is_parsed() -> None:
    assert ros().enclave == "/"
    assert ros("-e", "/secret").enclave == "/secret"
    assert ros("--enclave", "/secret").enclave == "/secret"


# Remaps


def test_rules_change_the_name_and_namespace_of_a_node() -> None:
    assert ros("-r", "__node:=new", "-r", "__ns:=/a/b").node_name("old", "/") == ("new", "/a/b")
    assert ros("--remap", "__name:=new").node_name("old", "/ns") == ("new", "/ns")
    assert ros("-r", "__ns:=/").node_name("old", "/ns") == ("old", "/")


def test_a_rule_with_a_prefix_applies_only_to_that_node() -> None:
    arguments = ros("-r", "one:__node:=uno", "-r", "two:__ns:=/zwei", "-r", "uno:a:=b", "-r", "uno:__ns:=/x")
    assert arguments.node_name("one", "/") == ("uno", "/x")
    assert arguments.node_name("two", "/") == ("two", "/zwei")
    assert arguments.remap_topic("/x/a", "uno", "/x") == "/x/b"
    assert arguments.remap_topic("/x/a", "two", "/x") == "/x/a"


def test_names_in_rules_expand_relative_to_the_node() -> None:
    arguments = ros("-r", "chatter:=talk", "-r", "~/status:=/status", "-r", "/fixed:=~/mine")
    assert arguments.remap_topic("/ns/chatter", "n", "/ns") == "/ns/talk"
    assert arguments.remap_topic("/chatter", "n", "/ns") == "/chatter"
    assert arguments.remap_topic("/ns/n/status", "n", "/ns") == "/status"
    assert arguments.remap_topic("/fixed", "n", "/ns") == "/ns/n/mine"


def test_the_first_matching_rule_applies() -> None:
    assert ros("-r", "a:=b", "-r", "a:=c", "-r", "b:=d").remap_topic("/a", "n", "/") == "/b"


def test_a_rule_may_apply_to_topics_or_services_only() -> None:
    arguments = ros("-r", "rostopic://a:=t", "-r", "rosservice://a:=s", "-r", "b:=both")
    assert arguments.remap_topic("/a", "n", "/") == "/t"
    assert arguments.remap_service("/a", "n", "/") == "/s"
    assert arguments.remap_topic("/b", "n", "/") == arguments.remap_service("/b", "n", "/") == "/both"


@pytest.mark.parametrize(
    "rule",
    ["a", "a:=", ":=b", "a:=b:=c", "a/:=b", "a:=b/", "1a:=b", "a:=*", "*:=a", "__node:=/a", "__ns:=a", "a:b"],
)
def test_an_invalid_rule_is_an_error_of_one_line(rule: str) -> None:
    with pytest.raises(RCLInvalidROSArgsError, match="Failed to parse ROS arguments: '-r ") as caught:
        ros("-r", rule)
    assert "\n" not in str(caught.value)


def test_arguments_of_a_node_precede_those_of_its_process() -> None:
    process = ros("-r", "a:=process", "-r", "b:=process", "-p", "x:=1", "-p", "y:=1")
    node = ros("-r", "a:=node", "-p", "x:=2")
    arguments = node.before(process)
    assert arguments.remap_topic("/a", "n", "/") == "/node"
    assert arguments.remap_topic("/b", "n", "/") == "/process"
    assert values(arguments, "/n") == {"x": 2, "y": 1}


def test_log_outputs_are_those_of_the_process() -> None:
    assert not ros("-e", "/mine").before(ros("--disable-rosout-logs")).rosout_logs


# Parameters


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("true", True),
        ("off", False),
        ("Y", True),
        ("42", 42),
        ("-7", -7),
        ("0x1F", 31),
        ("010", 8),
        ("08", 8.0),
        ("9223372036854775808", 9223372036854775808.0),
        ("2.5", 2.5),
        ("1e3", 1000.0),
        ("-.5", -0.5),
        ("1.", 1.0),
        (".inf", float("inf")),
        ("-inf", float("-inf")),
        ("1e999", "1e999"),
        ("9" * 5000, "9" * 5000),
        ("hello", "hello"),
        ("hello world", "hello world"),
        ("a:b", "a:b"),
        ("10:30", "10:30"),
        ("~", "~"),
        ("null", "null"),
        ("'42'", "42"),
        ('"true"', "true"),
        ("!!str 42", "42"),
        ("!!int 42", 42),
        ("!!float 42", 42),
        ("!mine on", True),
        ("!!int '42'", "42"),
        ("! '42'", "42"),
        ("|\n 42", 42),
        ("|\n forty\n two", "forty\ntwo"),
        ("[1, 2]", [1, 2]),
        ("[1.0, 2.5]", [1.0, 2.5]),
        ("[a, 'b c']", ["a", "b c"]),
        ("[true, off]", [True, False]),
        ("[]", None),
        ("''", ""),
        ("/dev/ttyS0", "/dev/ttyS0"),
    ],
)
def test_a_value_has_the_type_that_ros_gives_its_text(text: str, value: Any) -> None:
    found = values(ros("-p", f"x:={text}"), "/n")["x"]
    assert found == value
    assert type(found) is type(value)


def test_nan_is_a_value() -> None:
    assert str(values(ros("-p", "x:=.nan"), "/n")["x"]) == "nan"


def test_parameters_apply_to_all_nodes_or_to_one_name() -> None:
    arguments = ros("-p", "x:=1", "--param", "talker:x:=2", "-p", "talker:a.b:=3")
    assert values(arguments, "/ns/listener") == {"x": 1}
    assert values(arguments, "/talker") == {"x": 2, "a.b": 3}


def test_a_parameter_may_be_named_after_a_topic() -> None:
    name = "qos_overrides./chatter.publisher.depth"
    assert values(ros("-p", f"{name}:=5"), "/n") == {name: 5}


@pytest.mark.parametrize(
    ("rule", "reason"),
    [
        ("x", "expected"),
        ("x:=", "expected"),
        (":=1", "expected"),
        ("1x:=1", "expected"),
        ("a/1:=1", "expected"),
        ("a.1:=1", "expected"),
        ("a." + "x" * 40 + "=1", "expected"),
        ("x:={a: 1}", "a mapping is not a value"),
        ("x:=!!str", "it has no value"),
        ("x:=[1, a]", "must be of one type, found integer and string"),
        ("x:=[1, 2.0]", "must be of one type, found integer and double"),
        ("x:=[[1]]", "a list may contain scalars only, found a list"),
        ("x:=[1", "line 1: "),
        ("x:=*a", "aliases are not supported"),
        ("x:=" + "[" * 5000, "nested too deeply"),
    ],
)
def test_an_invalid_parameter_is_an_error_of_one_line(rule: str, reason: str) -> None:
    with pytest.raises(RCLInvalidROSArgsError, match=reason) as caught:
        ros("-p", rule)
    assert "\n" not in str(caught.value)
    assert rule in str(caught.value)


# Parameter files


def write(directory: Path, text: str) -> str:
    path = directory / "parameters.yaml"
    path.write_text(text)
    return str(path)


def test_a_file_gives_nodes_their_parameters(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        """
        talker:
          ros__parameters:
            rate: 10
            name: "10"
            gains: {p: 1.5, i: {limit: 2}}
            flags: [yes, no]
        /ns:
          listener:
            ros__parameters: {rate: 20}
        /ns/third:
          ros__parameters: {rate: 30}
        empty:
          ros__parameters:
        """,
    )
    arguments = ros("--params-file", path)
    assert values(arguments, "/talker") == {
        "rate": 10,
        "name": "10",
        "gains.p": 1.5,
        "gains.i.limit": 2,
        "flags": [True, False],
    }
    assert values(arguments, "/ns/listener") == {"rate": 20}
    assert values(arguments, "/ns/third") == {"rate": 30}
    assert values(arguments, "/ns/talker") == {}


@pytest.mark.parametrize(
    ("pattern", "matching", "others"),
    [
        ("/**", ["/n", "/a/n", "/a/b/n"], []),
        ("/*", ["/n"], ["/a/n"]),
        ("/*/n", ["/a/n"], ["/n", "/a/b/n"]),
        ("/**/n", ["/n", "/a/n", "/a/b/n"], ["/a/nn"]),
        ("/a/**", ["/a/n", "/a/b/n", "/a"], ["/b/n", "/ab/n"]),
        ("/a/*/n", ["/a/b/n"], ["/a/n", "/a/b/c/n"]),
        ("**/n", ["/a/n", "/n"], []),
        ("n", ["/n"], ["/a/n"]),
    ],
)
def test_wildcards_stand_for_one_or_any_number_of_names(
    tmp_path: Path, pattern: str, matching: list[str], others: list[str]
) -> None:
    arguments = ros("--params-file", write(tmp_path, f"'{pattern}': {{ros__parameters: {{x: 1}}}}"))
    assert [fqn for fqn in matching + others if values(arguments, fqn)] == matching


def test_nested_wildcards_join(tmp_path: Path) -> None:
    arguments = ros("--params-file", write(tmp_path, "/**:\n  n:\n    ros__parameters: {x: 1}"))
    assert values(arguments, "/a/b/n") == {"x": 1}
    assert values(arguments, "/a/b/m") == {}


def test_later_sources_win_within_a_pattern_and_later_patterns_win(tmp_path: Path) -> None:
    path = write(tmp_path, "n: {ros__parameters: {x: 1, y: 1}}\n/**: {ros__parameters: {z: 1}}")
    assert values(ros("--params-file", path, "-p", "x:=2"), "/n") == {"x": 2, "y": 1, "z": 1}
    assert values(ros("-p", "x:=2", "--params-file", path), "/n") == {"x": 1, "y": 1, "z": 1}
    assert values(ros("-p", "n:x:=2", "--params-file", path), "/n") == {"x": 1, "y": 1, "z": 1}
    assert values(ros("--params-file", path, "-p", "n:x:=2"), "/n") == {"x": 2, "y": 1, "z": 1}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("n:\n  ros__parameters:\n    x: [1, a]", "line 3: n: x: the elements of a list must be of one type"),
        ("n:\n  ros__parameters:\n    x:", "line 3: n: x: it has no value"),
        ("n:\n  ros__parameters:\n    a:\n      b: [[1]]", "line 4: n: a.b: a list may contain scalars only"),
        ("n:\n  ros__parameters: 5", "line 2: n: expected a mapping of parameters, found '5'"),
        ("n:\n  x: 5", "line 2: n/x: expected a mapping of names of nodes, found '5'"),
        ("n:", "line 1: n: expected a mapping of names of nodes, found nothing"),
        ("- n", "line 1: expected a mapping of names of nodes, found a list"),
        ("ros__parameters: {x: 1}", "line 1: ros__parameters: there is no node name above it"),
        ("n?:\n  ros__parameters: {x: 1}", "line 2: n\\?: node name must not contain"),
        ("n:\n  ros__parameters: {1: 2, ? [a] : 3}", "line 2: n: a key must be a name"),
        ("n:\n ros__parameters: {x: 1\n", "line 3: "),
        ("n: &a\n  ros__parameters: {x: 1}\nm: *a", "line 3: aliases are not supported"),
    ],
)
def test_an_error_in_a_file_is_one_line_with_file_key_and_reason(
    tmp_path: Path, text: str, message: str
) -> None:
    path = write(tmp_path, text)
    with pytest.raises(RCLInvalidROSArgsError, match=message) as caught:
        ros("--params-file", path)
    assert path in str(caught.value)
    assert "\n" not in str(caught.value)


@given(text=st.text() | st.text("[]{}:,-'\"&*!#|>\n ~a1.", min_size=1))
def test_any_text_is_a_value_or_an_error_of_one_line(text: str) -> None:
    error_message = ""
    try:
        Parameter("x", value=parse_value(text))
    except ValueError as error:
        error_message = str(error)
    assert "\n" not in error_message


@given(text=st.text() | st.text("[]{}:,-'\"&*!#|>\n ~a1./", min_size=1))
@example(text="{0\n\n0}")
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_text_in_a_file_is_read_or_an_error_of_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "any.yaml"
    path.write_text(f"n:\n  ros__parameters:\n    {text}", encoding="utf-8", errors="replace")
    error_message = ""
    try:
        read_parameter_file(str(path))
    except ParameterFileError as error:
        error_message = str(error)
    assert "\n" not in error_message


def test_an_error_names_an_unreadable_file(tmp_path: Path) -> None:
    with pytest.raises(RCLInvalidROSArgsError, match=r"missing\.yaml: No such file"):
        ros("--params-file", str(tmp_path / "missing.yaml"))
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\xff")
    with pytest.raises(RCLInvalidROSArgsError, match=r"binary\.yaml"):
        ros("--params-file", str(tmp_path / "binary.yaml"))


def test_an_empty_file_sets_no_parameters(tmp_path: Path) -> None:
    assert values(ros("--params-file", write(tmp_path, "# nothing\n")), "/n") == {}


# Logging


@pytest.fixture
def logging_configuration() -> Iterator[None]:
    yield
    rclpy.logging._apply_arguments(RosArguments())
    rclpy.logging.shutdown()


@pytest.mark.usefixtures("logging_configuration")
def test_log_levels_apply_to_all_or_to_named_loggers(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ros("--log-level", "warn", "--log-level", "talker.arm:=DEBUG", "--disable-stdout-logs")
    assert arguments.log_level == LoggingSeverity.WARN
    assert arguments.log_levels == {"talker.arm": LoggingSeverity.DEBUG}
    rclpy.logging._apply_arguments(arguments)
    assert rclpy.logging.get_logger_effective_level("any") == LoggingSeverity.WARN
    assert rclpy.logging.get_logger_effective_level("talker.arm.left") == LoggingSeverity.DEBUG
    rclpy.logging.get_logger("talker").error("silent")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("level", ["loud", "talker:=loud", ":=info", "talker:="])
def test_an_invalid_log_level_is_an_error(level: str) -> None:
    with pytest.raises(RCLInvalidROSArgsError, match="--log-level"):
        ros("--log-level", level)


def test_the_last_option_decides_about_a_log_output() -> None:
    arguments = ros("--disable-rosout-logs", "--disable-stdout-logs", "--enable-stdout-logs")
    assert not arguments.rosout_logs
    assert arguments.stdout_logs
    assert ros("--disable-external-lib-logs").rosout_logs
