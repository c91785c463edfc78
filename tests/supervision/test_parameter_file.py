"""Mistakes in a user's parameter file."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from deploy.commands import parameter_file


def test_the_parameters_of_every_service_are_known() -> None:
    source = {"value"}
    declared = parameter_file.declared()
    assert {name: set(parameters) - {"use_sim_time"} for name, parameters in declared.items()} == {
        "config_l1": source,
        "config_l2": source,
        "config_theta1": source,
        "config_theta2": source,
        "dead_mans_switch": {"rate", "pressed"},
        "kinematics": set(),
        "velocity": set(),
        "operator_watchdog": {"lifespan", "sampling", "silence", "strikes", "repeat"},
        "engine_controller": {"max_presence_age", "presence_timeout", "repeat"},
        "sentinel": {"look", "silence", "start"},
    }


@pytest.mark.parametrize(
    "text",
    [
        "operator_watchdog: {ros__parameters: {silence: 2.0, strikes: 5}}",
        "/dead_mans_switch: {ros__parameters: {pressed: true}}",
        "/**: {ros__parameters: {repeat: 0.2}}",
        "{}",
    ],
)
def test_a_good_file_has_no_faults(text: str) -> None:
    assert list(parameter_file.faults(yaml.safe_load(text), "/")) == []


MISTAKES = """
pilot: {ros__parameters: {}}                            pilot: is no service; those are config_l1
operator_watchdog: {silence: 2.0}                       operator_watchdog: must hold ros__parameters
operator_watchdog: {ros__parameters: {silense: 2.0}}    operator_watchdog.silense: is no parameter; those are
operator_watchdog: {ros__parameters: {silence: 2}}      operator_watchdog.silence: must be a number with a
operator_watchdog: {ros__parameters: {strikes: 2.0}}    operator_watchdog.strikes: must be an integer, not 2.0
operator_watchdog: {ros__parameters: {strikes: 0}}      operator_watchdog.strikes: must be from 1 to 100
config_l1: {ros__parameters: {value: .nan}}             config_l1.value: must be from 0 to 1000, not nan
dead_mans_switch: {ros__parameters: {pressed: 1}}       dead_mans_switch.pressed: must be true or false, not 1
dead_mans_switch: {ros__parameters: {scenario: x}}      dead_mans_switch.scenario: is no parameter
/**: {ros__parameters: {silense: 2.0}}                  /**.silense: is no parameter
/**: {ros__parameters: {repeat: 0.03}}                  /**.repeat: must be from 0.05 to 10, not 0.03
/**: {ros__parameters: {value: -1.0}}                   /**.value: must be from 0 to 1000, not -1.0
[1]                                                     file: must name services
"""


@pytest.mark.parametrize("mistake", MISTAKES.strip().splitlines())
def test_a_mistake_is_told_with_its_key_and_the_reason(mistake: str) -> None:
    text, told = re.split("   +", mistake)
    ((key, fault),) = parameter_file.faults(yaml.safe_load(text), "/")
    assert f"{key}: {fault}".startswith(told)


@pytest.mark.parametrize(
    ("node", "good"),
    [("velocity", True), ("/arm1/velocity", True), ("/velocity", False), ("/arm2/velocity", False)],
)
def test_an_arm_in_a_namespace_names_its_services_with_it_or_without(node: str, good: bool) -> None:
    document = {node: {"ros__parameters": {}}}
    assert [key for key, _ in parameter_file.faults(document, "/arm1")] == ([] if good else [node])


def test_a_file_that_yaml_cannot_read_is_a_mistake_of_one_line(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("config_l1: {ros__parameters: {value: 2024-13-45}}")
    assert str(parameter_file.main(str(file))).startswith(f"{file}: month must be in")
