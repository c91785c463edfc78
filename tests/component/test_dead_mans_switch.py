from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest
import reactivex as rx
from rclpy.parameter import Parameter
from reactivex.testing import ReactiveTest, TestScheduler
from std_msgs.msg import String

from interfaces.topics import (
    ENGINES,
    ENGINES_STATE,
    OFF,
    ON,
    OPERATOR_HAND,
    OPERATOR_HEARTBEAT,
    TURN_OFF,
    TURN_ON,
)
from reactive_node.testing import SpinFor, SpinUntil
from services.dead_mans_switch import engine_commands, heartbeats, wire
from tests.component.wiring import Connect, Wired

on_next, subscribe = ReactiveTest.on_next, ReactiveTest.subscribe


def test_switch_beats_at_its_rate_while_it_is_pressed(
    scheduler: TestScheduler,
) -> None:
    pressed = scheduler.create_hot_observable(on_next(300, True), on_next(345, False), on_next(800, True))
    rate = scheduler.create_hot_observable(on_next(210, 0.1), on_next(830, 0.02))
    single = scheduler.create_hot_observable(on_next(500, True), on_next(805, True))

    results = scheduler.start(lambda: heartbeats(pressed, rate, single))

    times = [310, 320, 330, 340, 500, 805, 810, 820, 880, 930, 980]
    assert results.messages == [on_next(time, True) for time in times]
    assert [source.subscriptions for source in (pressed, rate, single)] == [[subscribe(200, 1000)]] * 3


def test_command_is_repeated_until_the_engines_obey(scheduler: TestScheduler) -> None:
    commands = scheduler.create_hot_observable(on_next(210, TURN_ON), on_next(300, TURN_OFF))
    states = scheduler.create_hot_observable(
        *(on_next(time, state) for time, state in [(215, OFF), (242, ON), (250, ON), (305, OFF)])
    )

    results = scheduler.start(lambda: engine_commands(commands, states, rx.never(), period=10))

    assert results.messages == [
        *(on_next(time, TURN_ON) for time in (210, 220, 230, 240)),
        on_next(300, TURN_OFF),
    ]
    assert states.subscriptions == [subscribe(210, 242), subscribe(300, 305)]


def test_command_that_is_not_obeyed_comes_ten_times_in_ten_seconds(scheduler: TestScheduler) -> None:
    commands = scheduler.create_hot_observable(on_next(210, TURN_ON))

    results = scheduler.start(lambda: engine_commands(commands, rx.never(), rx.never()))

    assert results.messages == [on_next(210 + second, TURN_ON) for second in range(10)]


def test_opposite_command_of_somebody_else_ends_the_repetition(scheduler: TestScheduler) -> None:
    commands = scheduler.create_hot_observable(on_next(210, TURN_ON), on_next(300, TURN_ON))
    states = scheduler.create_hot_observable(on_next(215, OFF))
    heard = scheduler.create_hot_observable(
        *(on_next(time, command) for time, command in [(211, TURN_ON), (221, TURN_ON), (225, TURN_OFF)])
    )

    results = scheduler.start(lambda: engine_commands(commands, states, heard, period=10, times=3))

    assert results.messages == [on_next(time, TURN_ON) for time in (210, 220, 300, 310, 320)]


def test_new_command_ends_the_repetition_of_the_last_one(scheduler: TestScheduler) -> None:
    commands = scheduler.create_hot_observable(on_next(210, TURN_ON), on_next(225, TURN_OFF))

    results = scheduler.start(lambda: engine_commands(commands, rx.never(), rx.never(), period=10, times=3))

    times = [(210, TURN_ON), (220, TURN_ON), (225, TURN_OFF), (235, TURN_OFF), (245, TURN_OFF)]
    assert results.messages == [on_next(time, command) for time, command in times]


Play = Callable[[str], Wired]


@pytest.fixture
def play(connect: Connect, spin_until: SpinUntil, tmp_path: Path) -> Play:
    """Begins a scenario with these commands of the virtual operator, the first of them at once."""

    def begin(engines: str) -> Wired:
        scenario = tmp_path / "scenario.yaml"
        scenario.write_text(f"engines: {engines}\n")
        switch = connect(
            wire,
            inputs=[ENGINES_STATE, ENGINES],
            outputs=[ENGINES, OPERATOR_HEARTBEAT],
            scenario=str(scenario),
            scenario_epoch=-1.0,
        )
        switch.service.set_parameters([Parameter("scenario_epoch", value=time.monotonic())])
        spin_until(lambda: switch.heard[ENGINES.name])
        return switch

    return begin


def commands_of(switch: Wired) -> list[str]:
    return [command.data for command in switch.heard[ENGINES.name]]


@pytest.mark.parametrize("pressed", [True, False])
def test_person_who_takes_the_switch_ends_the_commands_of_the_scenario(
    play: Play, spin_for: SpinFor, pressed: bool
) -> None:
    switch = play("[{at: 0.0, command: turn_off}, {at: 0.5, command: turn_on}]")
    assert commands_of(switch) == [TURN_OFF]

    switch.service.set_parameters([Parameter("pressed", value=pressed)])
    spin_for(1.5)  # in which the first would have been repeated and the second one due

    assert commands_of(switch) == [TURN_OFF]


def test_turn_off_by_a_person_ends_the_repetition_of_the_scenario(play: Play, spin_for: SpinFor) -> None:
    switch = play("[{at: 0.0, command: turn_on}]")
    assert commands_of(switch) == [TURN_ON]

    switch.publish(ENGINES, String(data=TURN_OFF))
    spin_for(1.5)  # in which the first would have been repeated

    assert commands_of(switch) == [TURN_ON, TURN_OFF]


def test_scenario_presses_the_switch(connect: Connect, spin_until: SpinUntil, tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("operator: {pressed: [{from: 0.0}]}\n")
    switch = connect(wire, outputs=[OPERATOR_HEARTBEAT], scenario=str(scenario), scenario_epoch=0.0)
    spin_until(lambda: switch.heard[OPERATOR_HEARTBEAT.name])


def test_restart_without_its_settings_presses_nothing(
    connect: Connect, spin_for: SpinFor, tmp_path: Path
) -> None:
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("operator: {pressed: [{from: 0.0}], heartbeats: [1.2]}\n")
    switch = connect(
        wire,
        outputs=[OPERATOR_HEARTBEAT],
        scenario=str(scenario),
        scenario_epoch=time.monotonic() - 1.0,
        settings=str(tmp_path / "settings"),
    )

    spin_for(0.5)

    assert switch.heard[OPERATOR_HEARTBEAT.name] == []


def test_pressed_switch_reports_whose_hand_it_is(connect: Connect, spin_until: SpinUntil) -> None:
    switch = connect(wire, outputs=[OPERATOR_HAND], pressed=True)
    spin_until(lambda: switch.heard[OPERATOR_HAND.name])

    assert switch.heard[OPERATOR_HAND.name][0].frame_id == switch.service.get_name()


def test_each_report_has_the_rate_of_the_heartbeats(
    connect: Connect, spin_until: SpinUntil, tmp_path: Path
) -> None:
    switch = connect(wire, outputs=[OPERATOR_HEARTBEAT], rate=7.0, settings=str(tmp_path / "s"))
    spin_until(lambda: switch.reports()[-1].get("parameter rate") == "7.0")

    switch.service.set_parameters([Parameter("rate", value=9.0)])
    spin_until(lambda: switch.reports()[-1].get("parameter rate") == "9.0")


@pytest.mark.parametrize(("is_taken", "beats"), [(False, [True]), (True, [])])
def test_scenario_sends_single_heartbeats_until_a_person_takes_the_switch(
    connect: Connect, spin_for: SpinFor, tmp_path: Path, is_taken: bool, beats: list[bool]
) -> None:
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("operator: {heartbeats: [0.3]}\n")
    switch = connect(wire, outputs=[OPERATOR_HEARTBEAT], scenario=str(scenario), scenario_epoch=-1.0)
    if is_taken:
        switch.service.set_parameters([Parameter("pressed", value=False)])
    switch.service.set_parameters([Parameter("scenario_epoch", value=time.monotonic())])
    if is_taken:
        spin_for(0.7)
    else:
        switch.spin_until(lambda: switch.heard[OPERATOR_HEARTBEAT.name])
    assert [each.data for each in switch.heard[OPERATOR_HEARTBEAT.name]] == beats
