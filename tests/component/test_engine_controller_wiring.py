from __future__ import annotations

import itertools
from datetime import timedelta
from typing import Any

import pytest
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter
from std_msgs.msg import Header, String

from interfaces.service import ServiceNode
from interfaces.service.clocks import HOST, Clocks
from interfaces.topics import ENGINES, ENGINES_STATE, OFF, ON, OPERATOR_PRESENCE, TURN_OFF, TURN_ON
from reactive_node import stamps
from reactive_node.testing import MakeNode, SpinUntil
from services.engine_controller import wire
from tests.component.wiring import Wired


@pytest.fixture
def wired(make_node: MakeNode, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr("interfaces.service.health.PERIOD", 3600.0)

    def make(**parameters: Any) -> Controller:
        return Controller(
            make_node,
            spin_until,
            wire,
            inputs=[ENGINES, OPERATOR_PRESENCE],
            outputs=[ENGINES_STATE],
            **parameters,
        )

    return make


class Controller(Wired):
    def see(self, age: float = 0.0) -> None:
        """Report an operator who was seen `age` seconds ago; return when the controller knows."""
        before = len(self.states)
        stamp = stamps.to_message(stamps.now() - timedelta(seconds=age))
        self.publish(OPERATOR_PRESENCE, Header(stamp=stamp))
        self.spin_until(lambda: len(self.states) >= before + 2)

    def command(self, name: str) -> None:
        self.publish(ENGINES, String(data=name))

    @property
    def states(self) -> list[str]:
        return [message.data for message in self.heard[ENGINES_STATE.name]]

    def await_state(self, state: str) -> None:
        self.spin_until(lambda: self.states[-1:] == [state])

    def await_rejection(self) -> str:
        self.spin_until(lambda: self.service.health.dropped)
        (remark,) = self.remarks()
        assert self.reports()[-1]["dropped"] == "1"
        return remark


def test_engines_follow_commands_while_the_operator_is_present(wired: Any) -> None:
    controller = wired()
    controller.await_state(OFF)
    controller.see()
    controller.command(TURN_ON)
    controller.await_state(ON)
    controller.command(TURN_OFF)
    controller.await_state(OFF)

    assert [state for state, _ in itertools.groupby(controller.states)] == [OFF, ON, OFF]
    assert controller.remarks() == []


def test_refused_turn_on_is_reported_and_counted(wired: Any) -> None:
    controller = wired()
    controller.command(TURN_ON)

    assert controller.await_rejection() == "engines: turn_on refused: no operator seen yet"
    assert set(controller.states) <= {OFF}


def test_turn_on_needs_a_presence_younger_than_the_parameter(wired: Any) -> None:
    controller = wired(max_presence_age=0.4)
    controller.see(age=0.4)
    controller.command(TURN_ON)

    assert controller.await_rejection().startswith("engines: turn_on refused: no operator seen for 0.")


def test_presence_is_as_old_as_its_stamp(wired: Any) -> None:
    controller = wired(presence_timeout=10.0)
    controller.see(age=0.0)
    controller.command(TURN_ON)
    controller.await_state(ON)
    controller.see(age=-1.0)

    assert "it is stamped by a clock that is" in controller.await_rejection()


def test_engines_turn_off_after_the_timeout_of_the_parameter(wired: Any) -> None:
    controller = wired(presence_timeout=1.0)
    controller.see()
    controller.command(TURN_ON)
    controller.await_state(ON)
    controller.spin_until(lambda: controller.states[-1:] == [OFF], 5.0)

    assert controller.remarks() == []


@pytest.mark.parametrize(
    ("name", "value"), [("presence_timeout", 10.1), ("max_presence_age", 1.1), ("repeat", 0.21)]
)
def test_parameter_that_delays_the_stop_is_refused(make_node: MakeNode, name: str, value: float) -> None:
    given = [Parameter(name, value=value)]
    with pytest.raises(ParameterException):
        wire(make_node(kind=ServiceNode, parameter_overrides=given))


def test_turn_on_is_refused_while_the_clock_of_another_host_is_wrong(
    wired: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(HOST, "robot")
    monkeypatch.setattr(Clocks, "refusal", lambda _: "the clock of host desk is wrong")
    controller = wired()
    controller.see()
    controller.command(TURN_ON)

    assert controller.await_rejection() == "engines: turn_on refused: the clock of host desk is wrong"


def test_turn_on_is_accepted_when_the_clock_of_another_host_is_right_again(
    wired: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusals = ["the clock of host desk is wrong"]
    monkeypatch.setenv(HOST, "robot")
    monkeypatch.setattr(Clocks, "refusal", lambda _: refusals[-1])
    controller = wired()
    controller.see()
    controller.command(TURN_ON)
    controller.await_rejection()
    refusals.append("")

    def is_on() -> bool:
        controller.see()
        controller.command(TURN_ON)
        return controller.states[-1] == ON

    controller.spin_until(is_on)


def test_clocks_are_looked_at_again_although_nobody_reports(
    wired: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusals, reports = [""], list[Any]()
    monkeypatch.setenv(HOST, "robot")
    monkeypatch.setattr(Clocks, "refusal", lambda _: refusals[-1])
    monkeypatch.setattr(Clocks, "hear", lambda _, report: reports.append(report))
    controller = wired()
    controller.spin_until(lambda: reports)  # its own first one: it makes no other
    controller.see()
    refusals.append("the clock of host desk is wrong")

    def is_refused() -> bool:
        controller.see()
        controller.command(TURN_ON)
        return bool(controller.service.health.dropped)

    controller.spin_until(is_refused)


def test_turn_on_is_refused_until_the_clocks_of_the_hosts_are_compared(
    wired: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(HOST, "robot")
    controller = wired()
    controller.see()
    controller.command(TURN_ON)

    words = "engines: turn_on refused: the clocks of the hosts are not compared yet"
    assert controller.await_rejection() == words


def test_turn_on_that_waited_is_refused(wired: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    controller = wired()
    controller.see()
    ages: list[Any] = []
    monkeypatch.setattr(controller.service, "age", lambda stamp: ages.append(stamp) or 1.5)
    controller.command(TURN_ON)

    assert controller.await_rejection() == "engines: turn_on refused: 1.500 s old"
    (source,) = ages
    assert abs(stamps.now() - source) < timedelta(seconds=1)  # the time of publishing
