"""The sources of time a clock, and every time it hands out, can belong to."""

from __future__ import annotations

from enum import IntEnum


class ClockType(IntEnum):
    """
    Source of a time; the values are those of `rcl_clock_type_t`.

    `ROS_TIME` is simulated time while `use_sim_time` is on and system time otherwise, `SYSTEM_TIME` the wall
    clock since 1970, `STEADY_TIME` monotonic since an arbitrary origin.
    """

    UNINITIALIZED = 0
    ROS_TIME = 1
    SYSTEM_TIME = 2
    STEADY_TIME = 3
