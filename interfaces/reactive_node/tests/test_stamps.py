from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped
from hypothesis import given
from hypothesis import strategies as st
from std_msgs.msg import Header

from reactive_node import Timestamp, stamps


@given(st.integers(-(2**31), 2**31 - 1), st.integers(0, 10**9 - 1))
def test_stamps_lose_less_than_a_microsecond(seconds: int, nanoseconds: int) -> None:
    stamp = Time(sec=seconds, nanosec=nanoseconds)

    assert stamps.to_message(stamps.from_message(stamp)) == Time(
        sec=seconds, nanosec=nanoseconds // 1000 * 1000
    )


def test_now_is_time_of_day() -> None:
    assert abs(stamps.now() - datetime.now(UTC)) < timedelta(seconds=1)


def test_nanoseconds_count_from_1970_and_round_down_to_microseconds() -> None:
    second = datetime(1970, 1, 1, 0, 0, 1, 2, UTC)

    assert stamps.from_nanoseconds(1_000_002_999) == second
    assert stamps.from_nanoseconds(-1) == datetime(1969, 12, 31, 23, 59, 59, 999_999, UTC)
    assert stamps.to_nanoseconds(second) == 1_000_002_000
    assert stamps.to_nanoseconds(datetime(1969, 12, 31, 23, 59, 59, 999_999, UTC)) == -1000


def test_message_of_a_time_has_its_seconds_and_nanoseconds() -> None:
    time = datetime(1970, 1, 1, 0, 1, 5, 7, UTC)

    assert stamps.to_message(time) == Time(sec=65, nanosec=7000)
    assert stamps.from_message(Time(sec=65, nanosec=7999)) == time


def test_a_value_is_stamped_to_the_nanosecond() -> None:
    item = stamps.stamped("a", 1_000_000_007)

    assert isinstance(item, Timestamp)
    assert (item.value, item.nanoseconds) == ("a", 1_000_000_007)


def test_a_message_is_stamped_by_its_header() -> None:
    message = PointStamped(header=Header(stamp=Time(sec=5, nanosec=123_456_789)))

    assert stamps.by_header(message) == stamps.stamped(message, 5_123_456_789)


def pickled(item: Any) -> Any:
    return pickle.loads(pickle.dumps(item))


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickled])
def test_timestamp_can_be_copied_and_pickled(duplicate: Callable[[Any], Any]) -> None:
    item = Timestamp(["value"], stamps.now())._replace(nanoseconds=1_000_000_001)

    twin = duplicate(item)

    assert type(twin) is Timestamp
    assert (twin.value, twin.nanoseconds) == (["value"], 1_000_000_001)
    assert (twin.value is item.value) == (duplicate is copy.copy)


def test_ros_time_of_nanoseconds_is_exact() -> None:
    assert stamps.time_message(1_700_000_000_123_456_789) == Time(sec=1_700_000_000, nanosec=123_456_789)


def test_header_that_nobody_has_filled_in_has_no_stamp() -> None:
    assert stamps.by_header(PointStamped()).nanoseconds == stamps.UNSTAMPED == -1
