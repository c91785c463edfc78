"""Times of messages."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st

from reactive_node import stamps


@given(st.integers(-(2**31), 2**31 - 1), st.integers(0, 10**9 - 1))
def test_stamps_lose_less_than_a_microsecond(seconds: int, nanoseconds: int) -> None:
    stamp = Time(sec=seconds, nanosec=nanoseconds)

    assert stamps.to_message(stamps.from_message(stamp)) == Time(
        sec=seconds, nanosec=nanoseconds // 1000 * 1000
    )


def test_now_is_time_of_day() -> None:
    assert abs(stamps.now() - datetime.now(UTC)) < timedelta(seconds=1)
