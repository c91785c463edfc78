from __future__ import annotations

import math
import threading
import time
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from typing import Any

import pytest
import reactivex as rx
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.time import Time
from rclpy.timer import Timer
from reactivex.disposable import BooleanDisposable
from reactivex.subject import Subject
from std_msgs.msg import Empty

from interfaces.reactive_node.tests.simulated import Simulation
from reactive_node import ReactiveNode
from reactive_node.scheduler import NodeScheduler
from reactive_node.testing import MakeNode, SpinFor, SpinUntil


@pytest.fixture
def scheduler(make_node: MakeNode) -> NodeScheduler:
    node: ReactiveNode = make_node("timed")
    return node.scheduler


def test_actions_run_in_order_of_due_time_then_of_scheduling(
    scheduler: NodeScheduler, spin_until: SpinUntil
) -> None:
    ran: list[str] = []
    scheduler.schedule_relative(0.5, lambda *_: ran.append("later"))
    for name in "abc":
        scheduler.schedule(lambda _, state: ran.append(state), name)
    scheduler.schedule_absolute(scheduler.now + timedelta(milliseconds=10), lambda *_: ran.append("soon"))

    assert ran == []
    spin_until(lambda: len(ran) == 5)

    assert ran == ["a", "b", "c", "soon", "later"]


def test_operators_run_on_executor_thread_and_start_none(
    scheduler: NodeScheduler, spin_until: SpinUntil
) -> None:
    threads: set[int] = set()
    before = {*threading.enumerate()}
    numbers: Subject[int] = Subject()
    done: list[Any] = []
    for stream in (
        rx.interval(0.001).take(300),
        rx.interval(0.001).take(300).sample(0.01),
        rx.interval(0.001).take(300).timeout(1.0),
        rx.interval(0.001).take(300).debounce(0.0001),
        rx.interval(0.001).take(300).delay(0.01),
        numbers.timeout(1.0).take(1),
    ):
        stream.subscribe(
            lambda _: threads.add(threading.get_ident()),
            on_completed=lambda: done.append({*threading.enumerate()} - before),
            scheduler=scheduler,
        )
    scheduler.schedule_relative(0.1, lambda *_: numbers.on_next(1))

    spin_until(lambda: len(done) == 6)

    assert threads == {threading.get_ident()}
    assert done == [set()] * 6  # threads of earlier tests may end meanwhile


def test_cancelled_action_does_not_run(scheduler: NodeScheduler, spin_until: SpinUntil) -> None:
    ran: list[str] = []
    first = scheduler.schedule_relative(0.01, lambda *_: ran.append("first"))
    scheduler.schedule_relative(0.01, lambda *_: second.dispose())
    second = scheduler.schedule_relative(0.02, lambda *_: ran.append("second"))
    scheduler.schedule_relative(0.03, lambda *_: ran.append("third"))
    first.dispose()
    first.dispose()

    spin_until(lambda: "third" in ran)

    assert ran == ["third"]


def test_periodic_action_can_dispose_itself(
    scheduler: NodeScheduler, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    ran: list[int] = []

    def action(count: int | None) -> int:
        ran.append(count or 0)
        if len(ran) == 3:
            periodic.dispose()
        return (count or 0) + 1

    periodic = scheduler.schedule_periodic(0.001, action, 0)
    spin_until(lambda: len(ran) == 3)
    assert scheduler.kept == 0
    spin_for(0.02)

    assert ran == [0, 1, 2]


def test_disposing_item_disposes_result_of_its_action(
    scheduler: NodeScheduler, spin_until: SpinUntil
) -> None:
    inner = BooleanDisposable()
    ran: list[bool] = []

    def action(*_: Any) -> BooleanDisposable:
        ran.append(True)
        return inner

    outer = scheduler.schedule(action)
    spin_until(lambda: ran)
    assert not inner.is_disposed
    outer.dispose()

    assert inner.is_disposed


def test_scheduling_on_other_thread_wakes_executor(
    scheduler: NodeScheduler, executor: SingleThreadedExecutor
) -> None:
    ran: list[bool] = []
    scheduler.schedule_relative(60.0, lambda *_: None)
    executor.spin_once(timeout_sec=0.0)

    def later() -> None:
        time.sleep(0.1)
        scheduler.schedule(lambda *_: ran.append(True))

    thread = threading.Thread(target=later)
    begin = time.monotonic()
    thread.start()
    while not ran and time.monotonic() - begin < 20:
        executor.spin_once(timeout_sec=20)
    thread.join()

    assert time.monotonic() - begin < 10


def test_error_of_action_is_raised_by_spin_and_others_still_run(
    scheduler: NodeScheduler, spin_until: SpinUntil
) -> None:
    ran: list[str] = []

    def fail(*_: Any) -> None:
        raise ValueError("planted")

    scheduler.schedule(fail)
    scheduler.schedule(lambda *_: ran.append("next"))

    with pytest.raises(ValueError, match="planted"):
        spin_until(lambda: False)
    spin_until(lambda: ran)


def test_actions_left_by_many_cancellations_run_in_order(
    scheduler: NodeScheduler, spin_until: SpinUntil
) -> None:
    ran: list[int] = []
    begin = scheduler.now + timedelta(milliseconds=20)
    order = [(n * 7919) % 1000 for n in range(1000)]
    items = [
        scheduler.schedule_absolute(
            begin + timedelta(microseconds=n), lambda _, state: ran.append(state or 0), n
        )
        for n in order
    ]

    for item, n in zip(items, order, strict=True):
        if n % 10:
            item.dispose()
    spin_until(lambda: len(ran) == 100)

    assert ran == list(range(0, 1000, 10))


def test_setting_wall_clock_changes_nothing(
    make_node: MakeNode, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    node: ReactiveNode = make_node("timed")
    ticks: list[datetime] = []
    stream = rx.interval(0.01).timeout(1.0)
    stream.subscribe(lambda _: ticks.append(node.scheduler.now), scheduler=node.scheduler)
    read = Clock.now
    for hours in (1, -1):
        step = Duration(seconds=hours * 3600)

        def now(clock: Clock, step: Duration = step) -> Time:
            return read(clock) if clock.clock_type == ClockType.STEADY_TIME else read(clock) + step

        seen, before = len(ticks), read(node.get_clock())
        monkeypatch.setattr(Clock, "now", now)
        stepped = node.get_clock().now() - before
        assert abs(stepped.nanoseconds - step.nanoseconds) < 10 * 10**9
        spin_until(lambda seen=seen: len(ticks) >= seen + 5)

    assert all(timedelta(0) < b - a < timedelta(minutes=1) for a, b in pairwise(ticks))


@pytest.mark.parametrize("heard", [False, True])
def test_action_without_delay_runs_while_simulation_stands_still(
    simulation: Simulation, spin_until: SpinUntil, heard: bool
) -> None:
    if heard:
        simulation.set(100.0)
    items: list[int] = []
    rx.merge(rx.of(1, 2), rx.just(3)).subscribe(items.append, scheduler=simulation.node.scheduler)
    spin_until(lambda: len(items) == 3)


def test_action_that_reschedules_itself_leaves_executor_other_work(
    simulation: Simulation, spin_until: SpinUntil
) -> None:
    simulation.set(100.0)
    scheduler, most = simulation.node.scheduler, 10_000
    ran, others = 0, []
    other = simulation.clock.create_publisher(Empty, "other", 10)
    simulation.node.create_subscription(Empty, "other", lambda _: others.append(ran), 10)
    spin_until(lambda: other.get_subscription_count() == 1)

    def again(*_: Any) -> None:
        nonlocal ran
        ran += 1
        if ran == 1:
            other.publish(Empty())
        if ran < most and not others:
            scheduler.schedule(again)

    scheduler.schedule(again)
    spin_until(lambda: others)
    assert others[0] < most


def test_first_simulated_time_keeps_remaining_delays(
    simulation: Simulation, spin_for: SpinFor, spin_until: SpinUntil
) -> None:
    ran: list[datetime] = []
    scheduler = simulation.node.scheduler
    scheduler.schedule_relative(5.0, lambda *_: ran.append(scheduler.now))
    rx.interval(10.0).timestamp().subscribe(lambda it: ran.append(it.timestamp), scheduler=scheduler)

    simulation.set(1234.0)
    simulation.set(1238.9)
    spin_for(0.05)
    assert ran == []
    simulation.set(1239.0)
    spin_until(lambda: len(ran) == 1)
    simulation.set(1244.0)
    spin_until(lambda: len(ran) == 2)
    assert ran == [datetime.fromtimestamp(at, UTC) for at in (1239, 1244)]


def test_time_goes_on_when_running_node_gets_first_simulated_time(
    simulation: Simulation, make_node: MakeNode, spin_for: SpinFor, spin_until: SpinUntil
) -> None:
    node = make_node("later")
    ran: list[bool] = []
    node.set_parameters([Parameter("use_sim_time", value=True)])
    spin_until(lambda: simulation.publisher.get_subscription_count() == 2)
    node.scheduler.schedule_relative(5.0, lambda *_: ran.append(True))
    before = node.scheduler.now

    simulation.set(1234.0)
    spin_until(lambda: node.get_clock().now().nanoseconds == 1234_000_000_000)
    assert node.scheduler.now == before
    spin_for(0.05)
    assert ran == []
    simulation.set(1239.0)
    spin_until(lambda: ran)


def test_interval_does_not_drift_and_skips_missed_ticks(
    simulation: Simulation, spin_for: SpinFor, spin_until: SpinUntil
) -> None:
    ticks: list[int] = []
    simulation.set(100.0)
    rx.interval(1.0).subscribe(ticks.append, scheduler=simulation.node.scheduler)

    for time_, count in [(101.3, 1), (101.9, 1), (102.0, 2), (105.7, 3), (105.9, 3), (106.0, 4)]:
        simulation.set(time_)
        spin_until(lambda count=count: len(ticks) == count)
        spin_for(0.02)
        assert ticks == list(range(count))


def test_jump_back_lets_absolute_times_go_on(simulation: Simulation, spin_until: SpinUntil) -> None:
    """A periodic `timer` schedules absolute times; recipes compare the times of `timestamp`."""
    simulation.set(1000.0)
    ticks: list[Any] = []
    rx.timer(1.0, 2.0).timestamp().subscribe(ticks.append, scheduler=simulation.node.scheduler)

    for time_, count in [(1001.0, 1), (10.0, 1), (12.0, 2), (14.0, 3), (5.0, 3), (7.0, 4)]:
        simulation.set(time_)
        spin_until(lambda count=count: len(ticks) == count)

    assert [tick.timestamp for tick in ticks] == [
        datetime.fromtimestamp(at, UTC) for at in (1001, 1003, 1005, 1007)
    ]


def test_simulated_time_may_begin_and_end_while_action_waits(
    simulation: Simulation, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    node = simulation.node
    ran: list[str] = []
    simulation.set(1000.0)
    node.scheduler.schedule_relative(0.05, lambda *_: ran.append("real again"))
    spin_for(0.1)
    assert ran == []

    node.set_parameters([Parameter("use_sim_time", value=False)])
    spin_until(lambda: ran)
    node.set_parameters([Parameter("use_sim_time", value=True)])
    node.scheduler.schedule_relative(5.0, lambda *_: ran.append("simulated"))
    spin_for(0.05)
    assert ran == ["real again"]
    simulation.set(simulation.node.get_clock().now().nanoseconds / 1e9 + 5.0)
    spin_until(lambda: len(ran) == 2)


def test_steady_scheduler_follows_no_simulated_time(simulation: Simulation, spin_until: SpinUntil) -> None:
    """Simulated time starts late, runs, jumps a day both ways and stands still: supervision goes on."""
    node, began = simulation.node, time.monotonic()
    ticks: list[Any] = []
    rx.timer(0.0, 0.02, node.steady_scheduler).timestamp().subscribe(
        ticks.append, scheduler=node.steady_scheduler
    )
    spin_until(lambda: len(ticks) >= 3)  # before the first time
    for at in (1000.0, 1000.1, 1000.0 + 86_400.0, 1000.2, 1000.2, 0.5):
        simulation.set(at)
        count = len(ticks)
        spin_until(lambda count=count: len(ticks) >= count + 3)
    ages = [(tick.timestamp - ticks[0].timestamp).total_seconds() for tick in ticks]
    assert ages == sorted(ages)
    assert 0.0 <= ages[-1] <= time.monotonic() - began
    assert len(ticks) <= (time.monotonic() - began) / 0.02 + 1, "no tick is made up"


@pytest.mark.parametrize("name", ["scheduler", "steady_scheduler"])
def test_ended_node_runs_no_action(make_node: MakeNode, spin_for: SpinFor, name: str) -> None:
    node = make_node("ended")
    scheduler: NodeScheduler = getattr(node, name)
    ran: list[bool] = []
    scheduler.schedule_relative(0.01, lambda *_: ran.append(True))

    node.destroy_node()
    scheduler.schedule(lambda *_: ran.append(True))
    spin_for(0.03)

    assert ran == []


# Limits


def waiting(node: ReactiveNode) -> list[Timer]:
    return [timer for timer in node.timers if not timer.is_canceled()]


def test_actions_wait_on_the_steady_clock(node: ReactiveNode) -> None:
    node.scheduler.schedule_relative(60.0, lambda *_: None)

    timers = waiting(node)

    assert [timer.clock.clock_type for timer in timers] == [ClockType.STEADY_TIME]
    assert 59 < timers[0].time_until_next_call() / 1e9 <= 60


def test_time_begins_with_the_time_of_day(node: ReactiveNode) -> None:
    assert abs(node.scheduler.now - datetime.now(UTC)) < timedelta(seconds=1)


def test_time_of_stamps_follows_simulated_time(simulation: Simulation) -> None:
    for seconds in (1000, 10):
        simulation.set(seconds)
        assert simulation.node.scheduler.time_of_stamps() == seconds * 10**9


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
    def seconds() -> list[float]:
        return [each.time_until_next_call() / 1e9 for each in waiting(node)]

    ran: list[bool] = []
    assert seconds() == []
    node.scheduler.schedule(lambda *_: ran.append(True))
    spin_until(lambda: ran)
    assert seconds() == []

    ran.clear()
    node.scheduler.schedule_relative(0.01, lambda *_: ran.append(True))
    later = node.scheduler.schedule_relative(60.0, lambda *_: None)
    spin_until(lambda: ran)
    assert [round(each) for each in seconds()] == [60]

    later.dispose()
    node.scheduler.schedule(lambda *_: ran.append(True))
    spin_until(lambda: len(ran) == 2)
    assert [each for each in seconds() if each < 50] == []


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
    assert [timer.timer_period_ns for timer in waiting(node)] == [86_400 * 10**9]
