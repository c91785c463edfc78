from __future__ import annotations

import itertools
import math
import shutil
import socket
import time
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.parameter import Parameter
from reactivex import Observable
from reactivex.testing import ReactiveTest
from std_msgs.msg import String

from interfaces.permission import EngineState
from interfaces.service import host
from interfaces.topics import DRIVEN_TIME, ENGINES_STATE, OFF, ON, THETA1, DrivenTime
from reactive_node import stamps
from reactive_node.testing import SpinUntil, VirtualTime
from services import config_publisher, drive
from services.drive import driven_time
from tests.component.wiring import Connect, Wired

on_next = ReactiveTest.on_next

PERIOD = 0.125  # s; exact in binary


def driven(
    states: list[tuple[float, str, float]],
    until: float,
    begin: float = 0.0,
    pause: float = 0.0,
    full: tuple[float, float] = (0.0, 0.0),
) -> list[tuple[float, float]]:
    """:param states: when they arrive, the state, and its age.
    :param pause: which the process makes at 2.1 s.
    :param full: from when until when the disk is full.
    """
    scheduler = VirtualTime()
    items = [on_next(at, (name, age)) for at, name, age in states]
    heard = scheduler.create_hot_observable(*items).map(lambda it: EngineState(it[0], scheduler.now, it[1]))
    if pause:
        scheduler.schedule_absolute(2.1, lambda *_: scheduler.sleep(pause))

    def keep(_: float) -> bool:
        return not full[0] <= scheduler.now.timestamp() < full[1]

    results = scheduler.start(
        lambda: driven_time(heard, begin, PERIOD, keep), created=0.001, subscribed=1.0, disposed=until
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


def test_time_that_cannot_be_kept_does_not_pass() -> None:
    times = dict(driven(on(1.01, 6.0), 4.0, full=(2.0, 3.0)))

    assert {times[at] for at in times if 2.0 <= at < 3.0} == {times[1.875]}
    assert times[3.0] == times[1.875] + PERIOD


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
def start(connect: Connect, tmp_path: Path) -> Callable[..., Wired]:
    file = tmp_path / "scenario.yaml"
    file.write_text(SCENARIO + "drive: {rate: 50.0}\n")

    def begin(wire: Any, source: Any, output: Any, **parameters: Any) -> Wired:
        given = {"scenario": str(file), "settings": str(tmp_path), "scenario_epoch": time.monotonic() - 1.0}
        return connect(wire, inputs=[source], outputs=[output], **given | parameters)

    return begin


def start_drive(start: Callable[..., Wired]) -> Wired:
    return start(drive.wire, ENGINES_STATE, DRIVEN_TIME)


def times_of(wired: Wired) -> list[float]:
    return [DRIVEN_TIME.value(message).seconds for message in wired.heard[DRIVEN_TIME.name]]


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


def test_drive_whose_disk_is_full_stands_still_and_moves_no_joint_at_its_restart(
    start: Callable[..., Wired], spin_until: SpinUntil, tmp_path: Path
) -> None:
    (tmp_path / "service.yaml").write_text("time: 3.0\n")
    (tmp_path / "service.new").mkdir()  # as a full disk, the new file cannot be written
    first = start_drive(start)
    first.publish(ENGINES_STATE, String(data=ON))
    reason = "time: it stands still, because it cannot be kept: "
    spin_until(lambda: any(reason in it for it in first.remarks()))
    heard = len(times_of(first))
    spin_until(lambda: len(times_of(first)) > heard + 1)
    first.service.destroy_node()
    first.peer.destroy_node()

    second = start_drive(start)
    spin_until(lambda: times_of(second))

    assert {*times_of(first), *times_of(second)} == {3.0}


def test_drive_keeps_its_time_again_when_a_logout_has_removed_it(
    start: Callable[..., Wired], spin_until: SpinUntil, tmp_path: Path
) -> None:
    (tmp_path / "memory").mkdir()
    settings = tmp_path / "settings"
    settings.symlink_to(tmp_path / "memory")
    (settings / "service.yaml").write_text("time: 3.0\n")
    drive_ = start(drive.wire, ENGINES_STATE, DRIVEN_TIME, settings=str(settings))
    spin_until(lambda: times_of(drive_))
    shutil.rmtree(tmp_path / "memory")

    spin_until(lambda: (settings / "service.yaml").exists())
    assert (settings / "service.yaml").read_text() == "time: 3.0\n"
    assert drive_.remarks() == []


def test_drive_begins_at_the_beginning(start: Callable[..., Wired], spin_until: SpinUntil) -> None:
    first = start_drive(start)
    spin_until(lambda: times_of(first))

    assert times_of(first)[0] == 0.0


def test_drive_sends_its_time_at_the_rate_of_the_scenario(
    start: Callable[..., Wired], monkeypatch: pytest.MonkeyPatch
) -> None:
    periods: list[float] = []

    def record(states: Any, begin: float, period: float, keep: Callable[[float], bool]) -> Observable[float]:
        periods.append(period)
        return driven_time(states, begin, period, keep)

    monkeypatch.setattr(drive, "driven_time", record)
    start_drive(start)

    assert periods == [1 / 50.0]


def test_drive_names_its_host(start: Callable[..., Wired], spin_until: SpinUntil) -> None:
    wired = start_drive(start)
    spin_until(lambda: times_of(wired))

    driven = DRIVEN_TIME.value(wired.heard[DRIVEN_TIME.name][0])
    assert (driven.source, driven.host) == (host.identity(), socket.gethostname())
    assert time.time_ns() - driven.stamp < 60e9


def test_without_a_drive_in_the_scenario_it_says_nothing(connect: Connect, tmp_path: Path) -> None:
    (tmp_path / "scenario.yaml").write_text(SCENARIO)
    scenario = str(tmp_path / "scenario.yaml")
    node = connect(drive.wire, scenario=scenario).service

    assert DRIVEN_TIME.name not in [each.topic_name.strip("/") for each in node.publishers]


def start_joint(start: Callable[..., Wired]) -> Wired:
    return start(lambda node: config_publisher.wire(node, THETA1), DRIVEN_TIME, THETA1)


def publish_time(joint: Wired, seconds: float, source: str | None = None) -> None:
    driven = DrivenTime(time.time_ns(), seconds, host.identity() if source is None else source, "other-host")
    joint.publish(DRIVEN_TIME, DRIVEN_TIME.message(driven))


def angles(wired: Wired) -> list[float]:
    return [message.data for message in wired.heard[THETA1.name]]


def test_joint_plays_its_track_by_the_driven_time(start: Callable[..., Wired], spin_until: SpinUntil) -> None:
    joint = start_joint(start)
    for time_, expected in ((2.0, 1.0), (2.0, 1.0), (6.0, -1.0)):
        before = len(angles(joint))
        publish_time(joint, time_)
        spin_until(lambda before=before: len(angles(joint)) > before)  # type: ignore[misc]
        assert angles(joint)[-1] == pytest.approx(expected)


@pytest.mark.parametrize("other", ["", "another host"])
def test_joint_follows_the_drive_of_its_own_host_only(start: Callable[..., Wired], other: str) -> None:
    joint = start_joint(start)
    publish_time(joint, 6.0, other)
    joint.spin_until(lambda: joint.service.health.dropped)
    publish_time(joint, 2.0)
    joint.spin_until(lambda: angles(joint))
    publish_time(joint, 6.0, other)
    joint.spin_until(lambda: joint.service.health.dropped == 2)

    assert angles(joint) == [pytest.approx(1.0)]
    assert any("driven_time: the drive of host other-host publishes it, too" in it for it in joint.remarks())


def test_joint_whose_drive_goes_back_stands(start: Callable[..., Wired]) -> None:
    joint = start_joint(start)
    publish_time(joint, 2.0)
    joint.spin_until(lambda: angles(joint))
    publish_time(joint, 0.0)
    joint.spin_until(lambda: joint.service.health.dropped)

    assert angles(joint) == [pytest.approx(1.0)]
    assert any("driven_time: it went back" in it for it in joint.remarks())


def test_health_reports_how_fast_a_joint_moves_while_it_follows_its_drive(
    start: Callable[..., Wired],
) -> None:
    joint = start_joint(start)
    joint.remarks()
    assert float(joint.reports()[-1]["fastest"]) == pytest.approx(math.pi / 4.0, rel=1e-5)

    joint.service.set_parameters([Parameter("value", value=0.5)])
    joint.remarks()
    assert "fastest" not in joint.reports()[-1]
    assert joint.reports()[-1]["by hand"] == "value"

    joint.service.set_parameters([Parameter("follow_scenario", value=True)])
    joint.remarks()
    assert "by hand" not in joint.reports()[-1]
    assert "fastest" in joint.reports()[-1]


def test_joint_plays_no_time_that_waited(
    start: Callable[..., Wired], monkeypatch: pytest.MonkeyPatch
) -> None:
    joint = start_joint(start)
    monkeypatch.setattr(stamps, "now", lambda shift=timedelta(seconds=0.5), now=stamps.now: now() + shift)
    publish_time(joint, 2.0)

    joint.spin_until(lambda: joint.service.health.dropped)
    assert angles(joint) == []
