from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
import reactivex as rx
from rclpy.clock import ClockType
from rclpy.parameter import Parameter
from reactivex.disposable import BooleanDisposable

from interfaces.reactive_node.tests.simulated import Simulation
from reactive_node import ReactiveNode
from reactive_node.testing import MakeNode, SpinFor, SpinUntil


def test_actions_wait_on_the_steady_clock(node: ReactiveNode) -> None:
    node.scheduler.schedule_relative(60.0, lambda *_: None)

    waiting = [timer for timer in node.timers if not timer.is_canceled()]

    assert [timer.clock.clock_type for timer in waiting] == [ClockType.STEADY_TIME]
    assert 59 < waiting[0].time_until_next_call() / 1e9 <= 60


def test_time_begins_with_the_time_of_day(node: ReactiveNode) -> None:
    assert abs(node.scheduler.now - datetime.now(UTC)) < timedelta(seconds=1)


def test_actions_get_their_state(node: ReactiveNode, spin_until: SpinUntil) -> None:
    states: list[Any] = []
    for schedule in (
        lambda action: node.scheduler.schedule(action, "now"),
        lambda action: node.scheduler.schedule_relative(0.001, action, "soon"),
        lambda action: node.scheduler.schedule_absolute(node.scheduler.now, action, "then"),
    ):
        schedule(lambda scheduler, state: states.append((scheduler is node.scheduler, state)))
    spin_until(lambda: len(states) == 3)

    assert sorted(states) == [(True, "now"), (True, "soon"), (True, "then")]


def test_heap_is_cleaned_when_most_of_many_items_are_cancelled(node: ReactiveNode) -> None:
    scheduler = node.scheduler
    items = [scheduler.schedule_relative(60.0, lambda *_: None) for _ in range(100)]
    for item in items[:64]:
        item.dispose()
    items[0].dispose()  # again
    assert scheduler.kept == 100
    items[64].dispose()
    assert scheduler.kept == 35

    more = [scheduler.schedule_relative(60.0, lambda *_: None) for _ in range(165)]
    for item in more[:100]:
        item.dispose()
    assert scheduler.kept == 200  # half of them are still to run
    more[100].dispose()
    assert scheduler.kept == 99


@pytest.mark.parametrize(("late", "runs"), [(50_000_000, 6), (50_000_001, 1)])
def test_periodic_action_catches_up_if_it_is_at_most_50_ms_late(
    simulation: Simulation, spin_until: SpinUntil, spin_for: SpinFor, late: int, runs: int
) -> None:
    ran: list[datetime] = []
    scheduler = simulation.node.scheduler
    simulation.set_to(100 * 10**9)
    scheduler.schedule_periodic(0.01, lambda _: ran.append(scheduler.now))
    simulation.set_to(100 * 10**9 + 10_000_000 + late)
    spin_until(lambda: len(ran) >= runs)
    spin_for(0.05)

    assert len(ran) == runs


def test_ended_node_keeps_no_actions(make_node: MakeNode) -> None:
    node = make_node("ended")
    node.scheduler.schedule_relative(60.0, lambda *_: None)
    scheduler = node.scheduler
    timers = len([*node.timers])
    scheduler.dispose()
    assert len([*node.timers]) == timers - 1
    scheduler.schedule(lambda *_: None)
    assert scheduler.kept == 0
    node.destroy_node()
    node.scheduler.schedule(lambda *_: None)

    assert node.scheduler.kept == 0


def test_timer_waits_for_the_next_action_and_then_for_none(node: ReactiveNode, spin_until: SpinUntil) -> None:
    def waiting() -> list[float]:
        return [each.time_until_next_call() / 1e9 for each in node.timers if not each.is_canceled()]

    ran: list[bool] = []
    node.scheduler.schedule_relative(0.01, lambda *_: ran.append(True))
    later = node.scheduler.schedule_relative(60.0, lambda *_: None)
    spin_until(lambda: ran)
    assert [round(seconds) for seconds in waiting()] == [60]

    later.dispose()
    node.scheduler.schedule(lambda *_: ran.append(True))
    spin_until(lambda: len(ran) == 2)
    assert [seconds for seconds in waiting() if seconds < 50] == []


def test_only_cancelled_items_of_the_heap_count_for_its_cleaning(
    node: ReactiveNode, spin_until: SpinUntil
) -> None:
    scheduler = node.scheduler
    ran: list[bool] = []
    finished = [scheduler.schedule(lambda *_: ran.append(True)) for _ in range(100)]
    for item in [scheduler.schedule_relative(0.001, lambda *_: None) for _ in range(60)]:
        item.dispose()
    scheduler.schedule_relative(0.02, lambda *_: ran.append(True))
    spin_until(lambda: len(ran) == 101)
    for item in finished:
        item.dispose()

    items = [scheduler.schedule_relative(60.0, lambda *_: None) for _ in range(100)]
    for item in items[:64]:
        item.dispose()
    assert scheduler.kept == 100
    items[64].dispose()
    assert scheduler.kept == 35


def test_no_timer_waits_without_actions(node: ReactiveNode, spin_until: SpinUntil) -> None:
    ran: list[bool] = []
    assert [timer for timer in node.timers if not timer.is_canceled()] == []
    node.scheduler.schedule(lambda *_: ran.append(True))
    spin_until(lambda: ran)

    assert [timer for timer in node.timers if not timer.is_canceled()] == []


def test_time_goes_on_where_simulated_time_ends_and_begins(simulation: Simulation) -> None:
    simulation.set(1000.0)
    node = simulation.node
    timers: list[int] = []

    for simulated in (False, True, False, True):
        before = node.scheduler.now
        node.set_parameters([Parameter("use_sim_time", value=simulated)])
        assert timedelta(0) <= node.scheduler.now - before < timedelta(seconds=10)
        timers.append(len([*node.timers]))
    assert timers[:2] == timers[2:]


def test_result_of_an_action_that_disposed_itself_is_disposed(
    node: ReactiveNode, spin_until: SpinUntil
) -> None:
    result = BooleanDisposable()

    def action(*_: Any) -> BooleanDisposable:
        item.dispose()
        return result

    item = node.scheduler.schedule(action)
    spin_until(lambda: result.is_disposed)


def test_periodic_action_keeps_its_rate_from_the_first_simulated_time(
    simulation: Simulation, spin_for: SpinFor
) -> None:
    ran: list[float] = []
    scheduler = simulation.node.scheduler
    scheduler.schedule_periodic(10.0, lambda _: ran.append(scheduler.now.timestamp()))
    for second in (1234, 1243, 1244, 1253, 1254):
        simulation.set(second)
        spin_for(0.02)

    assert ran == [1244.0, 1254.0]


@pytest.mark.parametrize("seconds", [1e9, 1e10, 1e15])
def test_delay_longer_than_a_timer_of_ros_disturbs_no_other(
    node: ReactiveNode, spin_until: SpinUntil, seconds: float
) -> None:
    ticks: list[int] = []
    node.scheduler.schedule_relative(seconds, lambda *_: None)
    rx.interval(0.01).subscribe(ticks.append, scheduler=node.scheduler)
    spin_until(lambda: len(ticks) > 3)


@pytest.mark.parametrize("seconds", [math.inf, math.nan])
def test_delay_that_is_no_number_is_refused_and_leaves_nothing(node: ReactiveNode, seconds: float) -> None:
    for schedule in (node.scheduler.schedule_relative, node.scheduler.schedule_periodic):
        with pytest.raises((ValueError, OverflowError)):
            schedule(seconds, lambda *_: None)
    assert node.scheduler.kept == 0


def test_timer_of_a_far_action_runs_once_a_day_at_most(node: ReactiveNode) -> None:
    node.scheduler.schedule_relative(1e15, lambda *_: None)
    assert [timer.timer_period_ns for timer in node.timers if not timer.is_canceled()] == [86_400 * 10**9]
