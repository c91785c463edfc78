from __future__ import annotations

import operator
from typing import Any, cast

import pytest

import builtin_interfaces.msg
from rclpy.clock_type import ClockType
from rclpy.constants import S_TO_NS
from rclpy.duration import Duration, Infinite
from rclpy.time import Time

COMPARISONS = [operator.lt, operator.le, operator.eq, operator.ne, operator.gt, operator.ge]


def test_a_time_is_seconds_plus_nanoseconds() -> None:
    time = Time(seconds=1.5, nanoseconds=7)
    assert time.nanoseconds == 1_500_000_007
    assert time.seconds_nanoseconds() == (1, 500_000_007)
    assert time.clock_type == ClockType.SYSTEM_TIME


def test_large_whole_seconds_keep_their_nanoseconds() -> None:
    assert Time(seconds=1_700_000_000, nanoseconds=1).nanoseconds == 1_700_000_000 * S_TO_NS + 1


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ({"seconds": -1}, ValueError),
        ({"nanoseconds": -1}, ValueError),
        ({"nanoseconds": 2**63}, OverflowError),
        ({"seconds": 9.3e9}, OverflowError),
        ({"clock_type": "SYSTEM_TIME"}, TypeError),
        ({"clock_type": 2}, TypeError),
    ],
)
def test_an_invalid_time_is_an_error(arguments: dict[str, Any], error: type[Exception]) -> None:
    with pytest.raises(error):
        Time(**arguments)


def test_time_plus_or_minus_duration_is_a_time_of_the_same_clock() -> None:
    time = Time(nanoseconds=10, clock_type=ClockType.STEADY_TIME)
    for later in (time + Duration(nanoseconds=5), Duration(nanoseconds=5) + time):
        assert later == Time(nanoseconds=15, clock_type=ClockType.STEADY_TIME)
    assert (time - Duration(nanoseconds=4)).nanoseconds == 6
    with pytest.raises(ValueError, match="negative time"):
        time - Duration(nanoseconds=11)
    with pytest.raises(OverflowError):
        Time(nanoseconds=2**63 - 1) + Duration(nanoseconds=1)


def test_the_difference_of_times_may_be_negative() -> None:
    assert Time(nanoseconds=3) - Time(nanoseconds=10) == Duration(nanoseconds=-7)


def test_time_arithmetic_needs_durations_or_times() -> None:
    with pytest.raises(TypeError):
        Time() + 1  # type: ignore[operator]
    with pytest.raises(TypeError):
        Time() - 1.0  # type: ignore[operator]
    with pytest.raises(TypeError):
        Time() + Time()  # type: ignore[operator]


@pytest.mark.parametrize("comparison", COMPARISONS)
def test_times_of_different_clocks_cannot_be_compared_or_subtracted(comparison: Any) -> None:
    system, ros = Time(clock_type=ClockType.SYSTEM_TIME), Time(clock_type=ClockType.ROS_TIME)
    with pytest.raises(TypeError, match="different clock types"):
        comparison(system, ros)
    with pytest.raises(TypeError, match="different clock types"):
        system - ros


@pytest.mark.parametrize("comparison", COMPARISONS)
@pytest.mark.parametrize("kind", [Time, Duration])
def test_times_and_durations_compare_by_nanoseconds(comparison: Any, kind: Any) -> None:
    for left, right in [(1, 2), (2, 2), (2, 1)]:
        result = comparison(kind(nanoseconds=left), kind(nanoseconds=right))
        assert result is comparison(left, right)


def test_a_time_equals_only_times_and_has_no_hash() -> None:
    assert Time(nanoseconds=1) != 1
    assert Time() != Duration()
    with pytest.raises(TypeError, match="unhashable"):
        hash(Time())


def test_a_time_converts_to_a_message_and_back_as_ros_time() -> None:
    message = Time(seconds=2, nanoseconds=3).to_msg()
    assert (message.sec, message.nanosec) == (2, 3)
    assert Time.from_msg(message) == Time(seconds=2, nanoseconds=3, clock_type=ClockType.ROS_TIME)
    steady = Time.from_msg(message, clock_type=ClockType.STEADY_TIME)
    assert steady.clock_type == ClockType.STEADY_TIME
    with pytest.raises(TypeError, match="builtin_interfaces"):
        cast(Any, Time).from_msg(builtin_interfaces.msg.Duration())


def test_repr_and_str_are_those_of_rclpy() -> None:
    time = Time(nanoseconds=1, clock_type=ClockType.ROS_TIME)
    assert repr(time) == "Time(nanoseconds=1, clock_type=ROS_TIME)"
    assert repr(Duration(nanoseconds=2)) == "Duration(nanoseconds=2)"
    assert str(Duration(nanoseconds=2)) == "2 nanoseconds"
    assert str(Infinite) == "Infinite"


def test_a_duration_may_be_negative_but_must_fit_into_64_bits() -> None:
    assert Duration(seconds=-1.5).nanoseconds == -1_500_000_000
    assert Duration(seconds=1, nanoseconds=5).nanoseconds == 1_000_000_005
    for nanoseconds in (2**63, -(2**63) - 1):
        with pytest.raises(OverflowError):
            Duration(nanoseconds=nanoseconds)


def test_a_negative_duration_survives_conversion_to_a_message() -> None:
    message = Duration(nanoseconds=-1).to_msg()
    assert (message.sec, message.nanosec) == (-1, 999_999_999)
    assert Duration.from_msg(message) == Duration(nanoseconds=-1)
    with pytest.raises(TypeError, match="builtin_interfaces"):
        cast(Any, Duration).from_msg(builtin_interfaces.msg.Time())


def test_a_duration_is_neither_a_number_nor_hashable() -> None:
    assert Duration(nanoseconds=1) != 1
    with pytest.raises(TypeError):
        operator.lt(Duration(), 1)
    with pytest.raises(TypeError, match="unhashable"):
        hash(Duration())


def test_the_c_duration_of_a_duration_has_its_nanoseconds() -> None:
    assert Duration(nanoseconds=4).get_c_duration().nanoseconds == 4
