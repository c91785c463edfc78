from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.parameter import Parameter
from reactivex.testing import ReactiveTest
from std_msgs.msg import Float64, String

from interfaces.permission import EngineState
from interfaces.topics import DRIVEN_TIME, ENGINES_STATE, OFF, ON, THETA1
from reactive_node import stamps
from reactive_node.testing import MakeNode, SpinUntil, VirtualTime
from services import config_publisher, drive
from services.drive import driven_time
from tests.component.wiring import Wired

on_next = ReactiveTest.on_next

PERIOD = 0.125  # s; exact in binary


def driven(
    states: list[tuple[float, str, float]], until: float, begin: float = 0.0, pause: float = 0.0
) -> list[tuple[float, float]]:
    """:param states: when they arrive, the state, and its age.
    :param pause: which the process makes at 2.1 s.
    """
    scheduler = VirtualTime()
    items = [on_next(at, (name, age)) for at, name, age in states]
    heard = scheduler.create_hot_observable(*items).map(lambda it: EngineState(it[0], scheduler.now, it[1]))
    if pause:
        scheduler.schedule_absolute(2.1, lambda *_: scheduler.sleep(pause))
    results = scheduler.start(
        lambda: driven_time(heard, begin, PERIOD), created=0.001, subscribed=1.0, disposed=until
    )
    return [(message.time, message.value.value) for message in results.messages]


def on(begin: float, end: float, age: float = 0.0) -> list[tuple[float, str, float]]:
    return [(begin + 0.1 * n, ON, age) for n in range(round((end - begin) / 0.1))]


def test_time_stands_still_before_the_first_state() -> None:
    assert driven([], 1.3) == [(1.125, 0.0), (1.25, 0.0)]


def test_time_passes_while_the_engines_are_on() -> None:
    times = driven([*on(1.01, 2.0), (2.01, OFF, 0.0), *on(3.01, 3.5)], 3.5)

    assert dict(times)[2.0] == pytest.approx(1.0, abs=PERIOD)
    assert dict(times)[3.0] == dict(times)[2.125] == dict(times)[2.0]
    assert dict(times)[3.375] == pytest.approx(dict(times)[3.0] + 0.375, abs=PERIOD)


def test_off_stops_at_once() -> None:
    times = driven([(1.01, ON, 0.0), (1.2, OFF, 9.0)], 1.6)

    assert [time_ for _, time_ in times] == [PERIOD] * 4


@pytest.mark.parametrize(("age", "last"), [(0.0, 1.375), (0.1, 1.25), (-5.0, 1.375), (0.4, 0.0), (9.0, 0.0)])
def test_on_is_accepted_for_400_ms_from_its_source_time(age: float, last: float) -> None:
    times = [(1.0, 0.0), *driven([(1.01, ON, age)], 3.0)]

    moved = [at for (_, before), (at, after) in itertools.pairwise(times) if after > before]
    assert max(moved, default=0.0) == last


def test_of_two_controllers_none_moves_the_joints_against_the_other() -> None:
    other = [(2.06 + 0.1 * n, OFF, 0.0) for n in range(10)]  # until 2.96
    times = [(1.0, 0.0), *driven(sorted([*on(1.01, 4.0), *other]), 4.0)]

    moved = [at for (_, before), (at, after) in itertools.pairwise(times) if after > before]
    assert [at for at in moved if 2.0 < at < 3.6] == [3.5]
    assert {at for at in moved if at <= 2.0} == {at for at, _ in times if 1.0 < at <= 2.0}


def test_restarted_drive_goes_on_where_it_stopped() -> None:
    assert driven([], 1.2, begin=7.5) == [(1.125, 7.5)]


@pytest.mark.parametrize("pause", [0.29, 4.0])
def test_pause_moves_the_joints_by_two_periods_at_most(pause: float) -> None:
    times = driven(on(1.01, 9.0), 8.0, pause=pause)

    steps = [after - before for (_, before), (_, after) in itertools.pairwise(times)]
    assert max(steps) == pytest.approx(2 * PERIOD)


states = st.lists(st.tuples(st.floats(1.01, 6.0), st.sampled_from([ON, OFF]), st.floats(-1.0, 1.0)))


@given(states)
def test_no_state_moves_a_joint_for_longer_than_400_ms(states: list[tuple[float, str, float]]) -> None:
    heard = sorted(states)
    times = driven(heard, 8.0)

    for (_, before), (at, after) in itertools.pairwise(times):
        assert 0.0 <= after - before <= PERIOD + 1e-6
        if after > before:
            _, name, age = [state for state in heard if state[0] <= at][-1]
            arrived = max(state[0] for state in heard if state[0] <= at)
            assert name == ON
            assert not [state for state in heard if state[1] == OFF and at - 0.4 + 1e-5 < state[0] <= at]
            assert at <= arrived + 0.4 - max(age, 0.0) + 1e-5


# The processes

SCENARIO = "theta1: {center: 0.0, amplitude: 1.0, period: 8.0}\n"


@pytest.fixture
def start(make_node: MakeNode, spin_until: SpinUntil, tmp_path: Path) -> Callable[..., Wired]:
    file = tmp_path / "scenario.yaml"
    file.write_text(SCENARIO + "drive: {rate: 50.0}\n")

    def begin(wire: Any, source: Any, output: Any, **parameters: Any) -> Wired:
        given = {"scenario": str(file), "settings": str(tmp_path), "scenario_epoch": time.monotonic() - 1.0}
        return Wired(make_node, spin_until, wire, inputs=[source], outputs=[output], **given | parameters)

    return begin


def start_drive(start: Callable[..., Wired]) -> Wired:
    return start(drive.wire, ENGINES_STATE, DRIVEN_TIME)


def times_of(wired: Wired) -> list[float]:
    return [message.data for message in wired.heard[DRIVEN_TIME.name]]


def test_drive_runs_with_the_engines_and_goes_on_after_a_restart(
    start: Callable[..., Wired], spin_until: SpinUntil, tmp_path: Path
) -> None:
    (tmp_path / "service.yaml").write_text("time: 3.0\n")
    first = start_drive(start)
    spin_until(lambda: times_of(first)[-2:] == [3.0, 3.0])
    first.publish(ENGINES_STATE, String(data=ON))
    spin_until(lambda: times_of(first)[-1] > 3.0)
    spin_until(lambda: times_of(first)[-1] == times_of(first)[-2])  # it is not repeated
    last = times_of(first)[-1]
    assert last < 3.5  # how long it runs is tested in virtual time: a busy machine shortens it
    first.service.destroy_node()
    first.peer.destroy_node()

    second = start_drive(start)
    spin_until(lambda: times_of(second))

    assert times_of(second)[0] == last


def test_drive_begins_at_the_beginning(start: Callable[..., Wired], spin_until: SpinUntil) -> None:
    first = start_drive(start)
    spin_until(lambda: times_of(first))

    assert times_of(first)[0] == 0.0


def test_without_a_drive_in_the_scenario_it_says_nothing(
    make_node: MakeNode, spin_until: SpinUntil, tmp_path: Path
) -> None:
    (tmp_path / "scenario.yaml").write_text(SCENARIO)
    scenario = str(tmp_path / "scenario.yaml")
    node = Wired(make_node, spin_until, drive.wire, inputs=[], outputs=[], scenario=scenario).service

    assert DRIVEN_TIME.name not in [each.topic_name.strip("/") for each in node.publishers]


def start_joint(start: Callable[..., Wired]) -> Wired:
    return start(lambda node: config_publisher.wire(node, THETA1), DRIVEN_TIME, THETA1)


def angles(wired: Wired) -> list[float]:
    return [message.data for message in wired.heard[THETA1.name]]


def test_joint_plays_its_track_by_the_driven_time(start: Callable[..., Wired], spin_until: SpinUntil) -> None:
    joint = start_joint(start)
    for time_, expected in ((2.0, 1.0), (2.0, 1.0), (6.0, -1.0)):
        before = len(angles(joint))
        joint.publish(DRIVEN_TIME, Float64(data=time_))
        spin_until(lambda before=before: len(angles(joint)) > before)  # type: ignore[misc]
        assert angles(joint)[-1] == pytest.approx(expected)


def test_joint_plays_no_time_that_waited(
    start: Callable[..., Wired], monkeypatch: pytest.MonkeyPatch
) -> None:
    joint = start_joint(start)
    monkeypatch.setattr(stamps, "now", lambda shift=timedelta(seconds=0.5), now=stamps.now: now() + shift)
    joint.publish(DRIVEN_TIME, Float64(data=2.0))

    joint.spin_until(lambda: joint.service.health.dropped)
    assert angles(joint) == []


def test_joint_that_is_set_by_hand_is_given_back_to_the_drive(
    start: Callable[..., Wired], spin_until: SpinUntil
) -> None:
    joint = start_joint(start)
    joint.service.set_parameters([Parameter("value", value=0.5)])
    spin_until(lambda: angles(joint) == [0.5])
    joint.service.set_parameters([Parameter("follow_scenario", value=True)])
    joint.publish(DRIVEN_TIME, Float64(data=2.0))

    spin_until(lambda: angles(joint)[-1] == pytest.approx(1.0))
