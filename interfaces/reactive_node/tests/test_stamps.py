"""Times of messages."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st
from reactivex.testing import ReactiveTest, TestScheduler

from reactive_node import stamps
from reactive_node.stamps import Timestamp

on_next, subscribe = ReactiveTest.on_next, ReactiveTest.subscribe


def test_only_what_is_of_now_is_fresh(scheduler: TestScheduler) -> None:
    dropped: list[str] = []
    items = [
        Timestamp(n, datetime.fromtimestamp(t, UTC)) for n, t in enumerate([300.0, 299.5, 299.4, 300.5, 310])
    ]
    source = scheduler.create_hot_observable(*(on_next(300, item) for item in items))

    results = scheduler.start(
        lambda: stamps.fresh(source, lifespan=0.5, now=lambda: scheduler.now, dropped=dropped.append)
    )

    assert results.messages == [on_next(300, items[0]), on_next(300, items[1]), on_next(300, items[3])]
    assert dropped == ["it is 0.600 s old", "its clock is 10.000 s ahead of ours"]
    assert source.subscriptions == [subscribe(200, 1000)]


@given(st.integers(-(2**31), 2**31 - 1), st.integers(0, 10**9 - 1))
def test_stamps_lose_less_than_a_microsecond(seconds: int, nanoseconds: int) -> None:
    stamp = Time(sec=seconds, nanosec=nanoseconds)

    assert stamps.to_message(stamps.from_message(stamp)) == Time(
        sec=seconds, nanosec=nanoseconds // 1000 * 1000
    )


def test_now_is_time_of_day() -> None:
    assert abs(stamps.now() - datetime.now(UTC)) < timedelta(seconds=1)
