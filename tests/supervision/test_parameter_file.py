from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import ros_yaml

from deploy.supervision import manifest, parameter_file
from interfaces.service import UserError

Load = Callable[..., dict[str, Any]]
PARAMETERS = {
    "config_theta2": {"value", "follow_scenario"},
    "dead_mans_switch": {"rate", "pressed", "hand"},
    "kinematics": set(),
    "operator_watchdog": {"lifespan", "sampling", "silence", "strikes", "repeat"},
    "engine_controller": {"max_presence_age", "presence_timeout", "repeat"},
    "operator_page": {"port", "address", "names", "certificate", "key"},
    "sentinel": {"period", "health_timeout", "start_timeout"},
}


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Load:
    """Loads the file `mine.yaml` with a content."""
    monkeypatch.chdir(tmp_path)

    def load(content: str, namespace: str = "/") -> dict[str, Any]:
        Path("mine.yaml").write_text(content)
        return parameter_file.load("mine.yaml", namespace)

    return load


def test_the_parameters_of_every_program_are_known() -> None:
    declared = parameter_file.declared()
    assert [*declared] == [program.name for program in manifest.programs()]
    assert {name: set(declared[name]) - {"use_sim_time"} for name in PARAMETERS} == PARAMETERS


@pytest.mark.parametrize(
    "text",
    [
        "operator_watchdog: {ros__parameters: {silence: 2.0, strikes: 5}}",
        "/dead_mans_switch: {ros__parameters: {pressed: true}}",
        "/**: {ros__parameters: {repeat: 0.2}}",
        "operator_watchdog: {ros__parameters: {strikes: 1}}",
        "{}",
    ],
)
def test_a_good_file_has_no_errors(text: str) -> None:
    assert list(parameter_file.problems(ros_yaml.load(text), "/")) == []


ERRORS = """
pilot: {ros__parameters: {}}                            pilot: is no service; the services are
operator_watchdog: {silence: 2.0}                       operator_watchdog: must hold ros__parameters
operator_watchdog: {ros__parameters: {silense: 2.0}}    operator_watchdog.silense: is no parameter; the
operator_watchdog: {ros__parameters: {silence: 2}}      operator_watchdog.silence: must be a number with a
operator_watchdog: {ros__parameters: {strikes: 2.0}}    operator_watchdog.strikes: must be an integer, not 2.0
operator_watchdog: {ros__parameters: {strikes: 0}}      operator_watchdog.strikes: must be from 1 to 100
config_l1: {ros__parameters: {value: .nan}}             config_l1.value: must be from 0 to 1000, not nan
dead_mans_switch: {ros__parameters: {pressed: 1}}       dead_mans_switch.pressed: must be true or false, not 1
dead_mans_switch: {ros__parameters: {scenario: x}}      dead_mans_switch.scenario: is no parameter
operator_page: {ros__parameters: {address: 1}}       operator_page.address: must be a string, not 1
/**: {ros__parameters: {silense: 2.0}}                  /**.silense: is no parameter
/**: {ros__parameters: {repeat: 0.03}}                  /**.repeat of operator_watchdog: must be from
/**: {ros__parameters: {repeat: 0.5}}                   /**.repeat of engine_controller: must be from
dead_mans_switch: {ros__parameters: {rate: fast}}       dead_mans_switch.rate: must be a number
/**: {ros__parameters: {value: -1.0}}                   /**.value of config_l1: must be from 0 to 1000
{velocity: {ros__parameters: {}}, /velocity: {ros__parameters: {}}}   /velocity: is the service that the file
[1]                                                     file: must name services
"""


@pytest.mark.parametrize("error", ERRORS.strip().splitlines())
def test_an_error_has_its_key_and_reason(error: str) -> None:
    text, reported = re.split("   +", error)
    (key, problem), *_ = parameter_file.problems(ros_yaml.load(text), "/")
    assert f"{key}: {problem}".startswith(reported)


@pytest.mark.parametrize(
    ("node", "good"),
    [("velocity", True), ("/arm1/velocity", True), ("/velocity", False), ("/arm2/velocity", False)],
)
def test_services_are_named_with_the_namespace_or_without(node: str, good: bool) -> None:
    document = {node: {"ros__parameters": {}}}
    assert [key for key, _ in parameter_file.problems(document, "/arm1")] == ([] if good else [node])


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("a: &a 1\nb: *a", "line 2, column 4: the alias 'a' is refused: write its content again"),
        ("config_l1: {ros__parameters: {value: 1:1:1}}", "config_l1.value: must be a number with a decimal"),
        ("kinematics:", "kinematics: must hold ros__parameters"),
        ("5", "file: must name services"),
    ],
)
def test_an_error_of_yaml_is_one_line_with_the_file(load: Load, content: str, reason: str) -> None:
    with pytest.raises(UserError, match=rf"^mine.yaml: {re.escape(reason)}.*$"):
        load(content)


def test_all_errors_of_a_file_are_reported_a_line_for_each(load: Load) -> None:
    with pytest.raises(UserError) as raised:
        load("""
            operator_watchdog: {ros__parameters: {silence: -1.0, strikes: 0}}
            velocity: {ros__parameters: {rate: 1.0}}
            pilot: {}
        """)
    keys = ["operator_watchdog.silence", "operator_watchdog.strikes", "velocity.rate", "pilot"]
    lines = str(raised.value).splitlines()
    assert [line.split(": ")[:2] for line in lines] == [["mine.yaml", key] for key in keys]


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (
            "operator_watchdog: {ros__parameters: {sampling: 3.0}}",
            "sampling: must be less than silence, 3 s, not 3",
        ),
        (
            "operator_watchdog: {ros__parameters: {lifespan: 0.0994}}",
            "lifespan must be at least 0.1 s, not 0.0994: "
            "a heartbeat waits for up to half of it, and clocks differ by up to 0.05 s",
        ),
        (
            "{dead_mans_switch: {ros__parameters: {rate: 1000.0}}, "
            "operator_watchdog: {ros__parameters: {sampling: 0.05, silence: 0.1494}}}",
            "silence must be at least 0.15 s, not 0.1494: sampling and two periods of the switch"
            " (dead_mans_switch.rate), 0.05 s each: one lost heartbeat is no strike",
        ),
        (
            "{dead_mans_switch: {ros__parameters: {rate: 3.0}}, "
            "operator_watchdog: {ros__parameters: {silence: 1.1}}}",
            "silence must be at least 1.167 s, not 1.1: sampling and two periods of the switch"
            " (dead_mans_switch.rate), 0.333333 s each: one lost heartbeat is no strike",
        ),
        (
            "operator_watchdog: {ros__parameters: {silence: 1.0004, strikes: 1}}",
            "max_presence_age must be at most 0.45 s, not 1: "
            "a turn_on after the last strike would turn the engines on without an operator",
        ),
        (
            "operator_watchdog: {ros__parameters: {silence: 0.9}}",
            "max_presence_age must be at most 0.9 s, not 1: "
            "a turn_on after the last strike would turn the engines on without an operator",
        ),
        (
            "engine_controller: {ros__parameters: {max_presence_age: 0.69}}",
            "max_presence_age must be at least 0.7 s, not 0.69: "
            "an operator who is present is reported only so often (sampling, dead_mans_switch.rate)",
        ),
        (
            "{dead_mans_switch: {ros__parameters: {rate: 3.0}}, "
            "engine_controller: {ros__parameters: {max_presence_age: 0.98}}}",
            "max_presence_age must be at least 0.983 s, not 0.98: "
            "an operator who is present is reported only so often (sampling, dead_mans_switch.rate)",
        ),
        (
            "engine_controller: {ros__parameters: {presence_timeout: 2.0}}",
            "presence_timeout must be at least 2.2 s, not 2: "
            "lifespan, sampling and a restart of the operator watchdog, 1.2 s",
        ),
        (
            "{/**: {ros__parameters: {lifespan: 9.0}}, /arm1/velocity: {ros__parameters: {}}}",
            "presence_timeout must be at least 10.7 s, not 10: "
            "lifespan, sampling and a restart of the operator watchdog, 1.2 s",
        ),
    ],
)
def test_values_that_contradict_each_other_are_refused(load: Load, content: str, reason: str) -> None:
    with pytest.raises(UserError) as raised:
        load(content, "/arm1")
    assert str(raised.value) == f"mine.yaml: {reason}"


def test_value_of_a_service_counts_before_that_of_all_services(load: Load) -> None:
    shared = "/**: {ros__parameters: {strikes: 1, silence: 2.0}}"
    content = f"{{operator_watchdog: {{ros__parameters: {{strikes: 2}}}}, {shared}}}"
    found = parameter_file.reaction_to(load(content), "/")
    assert (found.watchdog.strikes, found.watchdog.silence) == (2, 2.0)


@pytest.mark.parametrize("content", ["", "# velocity:\n#   ros__parameters: {}\n", "{}"])
def test_a_file_without_content_changes_nothing(load: Load, content: str) -> None:
    assert load(content) == {}


def test_a_long_value_is_shown_in_part(load: Load) -> None:
    with pytest.raises(UserError) as raised:
        load(f"operator_watchdog: {{ros__parameters: {{strikes: 0x{5000 * 'f'}}}}}")
    assert len(str(raised.value)) < 120


def test_1e3_is_a_number(load: Load) -> None:
    loaded = load("dead_mans_switch: {ros__parameters: {rate: 1e3}}")
    assert loaded["/dead_mans_switch"]["ros__parameters"]["rate"] == 1000.0


def test_a_file_gets_the_full_names_of_the_nodes(load: Load) -> None:
    parameters = {"ros__parameters": {"value": 1.0}}
    content = ros_yaml.dump({"config_l1": parameters, "/arm1/config_l2": parameters})
    assert load(content, "/arm1").keys() == {"/arm1/config_l1", "/arm1/config_l2"}
