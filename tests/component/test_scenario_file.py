from __future__ import annotations

from pathlib import Path

import pytest

from interfaces.service import UserError
from interfaces.sources.scenario_file import Scenario, load
from interfaces.sources.timeline import Events, Sweep
from interfaces.topics import TURN_ON

SCENARIOS = Path(__file__).parents[2] / "deploy" / "scenarios"


def loaded(tmp_path: Path, text: str) -> Scenario:
    path = tmp_path / "scenario.yaml"
    path.write_text(text)
    return load(path)


def test_shipped_scenarios_load() -> None:
    assert [load(path) for path in sorted(SCENARIOS.glob("*.yaml"))]


def test_every_key_of_a_scenario(tmp_path: Path) -> None:
    scenario = loaded(
        tmp_path,
        """
        l1: 2.0
        l2: {center: 2.0, amplitude: 0.5, period: 1e1}
        theta1: {center: 0.8, amplitude: 0.5, period: 12.0, rate: 50, phase: 1.5, rest: 2.5}
        theta2: [{at: 1.5, value: 0.8}, {at: 4.0, value: 1.8}]
        operator: {pressed: [{from: 0.0, to: 40.0}, {from: 50.0}], heartbeats: [1.942, 1.991]}
        engines: [{at: 5.0, command: turn_on}]
        drive: {rate: 10}
        """,
    )

    assert scenario == Scenario(
        {
            "l1": Events(((0.0, 2.0),)),
            "l2": Sweep(2.0, 0.5, 10.0, rate=25.0, phase=0.0, rest=0.0),
            "theta1": Sweep(0.8, 0.5, 12.0, rate=50.0, phase=1.5, rest=2.5),
            "theta2": Events(((1.5, 0.8), (4.0, 1.8))),
        },
        Events(((0.0, True), (40.0, False), (50.0, True))),
        Events(((1.942, True), (1.991, True))),
        Events(((5.0, TURN_ON),)),
        10.0,
    )


def test_repeat_applies_to_all_events(tmp_path: Path) -> None:
    scenario = loaded(
        tmp_path,
        """
        l1: [{at: 1.0, value: 2.0}]
        operator: {pressed: [{from: 0.0, to: 4.0}], heartbeats: [2.0]}
        engines: [{at: 3.0, command: turn_on}]
        repeat: 5.0
        """,
    )

    timelines = (scenario.configuration["l1"], scenario.pressed, scenario.heartbeats, scenario.commands)
    assert [timeline.repeat for timeline in timelines if isinstance(timeline, Events)] == [5.0] * 4


def test_drive_has_a_rate_by_default(tmp_path: Path) -> None:
    assert [loaded(tmp_path, text).drive for text in ("drive: {}", "l1: 2.0")] == [25.0, None]


def test_numbers_are_those_of_ros(tmp_path: Path) -> None:
    assert loaded(tmp_path, "l1: 010").configuration["l1"] == Events(((0.0, 8.0),))
    assert loaded(tmp_path, "l1: 1e1").configuration["l1"] == Events(((0.0, 10.0),))


def test_empty_scenario_drives_nothing(tmp_path: Path) -> None:
    assert loaded(tmp_path, "") == Scenario()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "l3: 1.0",
            "scenario: unknown key 'l3', must be one of drive, engines, l1, l2, operator, repeat, theta1, "
            "theta2",
        ),
        (
            "- 1",
            "scenario: must be a mapping with drive, engines, l1, l2, operator, repeat, theta1, theta2, "
            "not [1]",
        ),
        ("l1: -1.0", "l1: -1.0 is negative"),
        ("l1: .nan", "l1: must be from -1e+09 to 1e+09"),
        ("l1: .inf", "l1: must be from -1e+09 to 1e+09"),
        pytest.param("l1: 1" + 300 * "0", "l1: must be from -1e+09 to 1e+09", id="300 digits"),
        pytest.param("l1: 1" + 400 * "0", "l1: must be a number, not '1000", id="400 digits"),
        pytest.param("l1: 1" + 3000 * ":1", "l1: must be a number, not '1:1", id="3000 colons"),
        pytest.param("l1: 0x" + 5000 * "f", "l1: must be a number, not '0xff", id="5000 digits"),
        pytest.param("l1: " + 2000 * "[", "line 1, column 36: is nested more than 32", id="2000 brackets"),
        ("l1: &a [*a]", "line 1, column 9: the alias 'a' is refused: write its content again"),
        ("l1: 1:30", "l1: must be a number, not '1:30'"),
        ("l1: ~", "l1: must be a number, not '~'"),
        ("l1: [{at: 1e12, value: 1}]", "l1[0].at: must be from -1e+09 to 1e+09"),
        ("operator: {pressed: [{from: 0, to: 1e12}]}", "operator.pressed[0].to: must be from -1e+09 to"),
        ("theta1: yes", "theta1: must be a number, not True"),
        ("theta1: fast", "theta1: must be a number, not 'fast'"),
        ("theta1: []", "theta1: is empty"),
        ("theta1: [{at: 1.0}]", "theta1[0]: missing key 'value'"),
        ("theta1: [{at: -1, value: 0}]", "theta1[0].at: must be at least 0, not -1"),
        ("l1: [{at: 0, value: 1}, {at: 1, value: -2}]", "l1[1].value: -2.0 is negative"),
        ("l1: [{at: 2, value: 1}, {at: 1, value: 1}]", "l1[1]: is at 1 s, before the previous entry"),
        ("l1: {center: 1, amplitude: 2, period: 3}", "l1.amplitude: at its lowest, -1.0 is negative"),
        ("l1: {center: 1, amplitude: 1, period: 0}", "l1.period: must be at least 0.001, not 0"),
        ("l1: {center: 1, amplitude: 1, period: 1, rate: 0}", "l1.rate: must be at least 0.001, not 0"),
        ("l1: {center: 1, amplitude: 1, period: 1, rate: 1e9}", "l1.rate: must be at most 1000, not 1e+09"),
        (
            "l1: {center: 1, amplitude: 1, period: 4, rest: 2}",
            "l1.rest: must be less than half the period, 2 s",
        ),
        (
            "l1: {centre: 1}",
            "l1: unknown key 'centre', must be one of amplitude, center, period, phase, rate, rest",
        ),
        ("operator: {pressed: true}", "operator.pressed: must be a list, not True"),
        ("operator: {pressed: [{from: 2, to: 1}]}", "operator.pressed[0].to: must be more than 2, not 1"),
        (
            "operator: {pressed: [{from: 0}, {from: 9}]}",
            "operator.pressed[1]: comes after an entry without `to`",
        ),
        (
            "operator: {let_go: {every: 9, for: 1}}",
            "operator: unknown key 'let_go', must be one of heartbeats, pressed",
        ),
        ("operator: {heartbeats: [1, x]}", "operator.heartbeats[1]: must be a number, not 'x'"),
        ("engines: [{at: 1, command: stop}]", "engines[0].command: must be turn_on or turn_off, not 'stop'"),
        (
            "{engines: [{at: 9, command: turn_on}], repeat: 5}",
            "engines: ends at 9 s, but everything starts again after 5 s",
        ),
        ("repeat: 0", "repeat: must be at least 0.001, not 0"),
        ("l1: [1", "line 2, column 1: while parsing a flow sequence, did not find expected ',' or ']'"),
        ("l1: 2\nl1: 3", "line 2, column 1: the key 'l1' appears twice"),
        ("l1: 2024-02-30", "l1: must be a number, not '2024-02-30'"),
        ("l1: \a", "line 1: control characters are not allowed"),
    ],
)
def test_error_is_one_line_with_file_key_and_reason(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(UserError) as raised:
        loaded(tmp_path, text)

    message = str(raised.value)
    assert message.startswith(f"{tmp_path / 'scenario.yaml'}: {reason}")
    assert "\n" not in message
    assert len(message) < 300


def test_each_wrong_key_of_a_scenario_is_reported(tmp_path: Path) -> None:
    with pytest.raises(UserError) as raised:
        loaded(tmp_path, "{l1: -1, l3: 0, l2: 1, drive: 5, repeat: 1, engines: [{at: 2, command: turn_on}]}")
    keys = [line.split(": ")[1] for line in str(raised.value).splitlines()]
    assert keys == ["scenario", "l1", "drive"]


def test_error_names_a_missing_file() -> None:
    with pytest.raises(UserError, match=r"^nowhere\.yaml: No such file or directory$"):
        load("nowhere.yaml")
