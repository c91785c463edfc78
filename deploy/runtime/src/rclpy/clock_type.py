"""The types of clocks and times."""

from __future__ import annotations

from enum import IntEnum


class ClockType(IntEnum):
    """Type of a clock or time; the values are those of `rcl_clock_type_t`.

    `ROS_TIME` is simulated time while `use_sim_time` is set, otherwise system time. `SYSTEM_TIME` is wall
    time since 1970. `STEADY_TIME` is monotonic, with an arbitrary origin.
    """

    UNINITIALIZED = 0
    ROS_TIME = 1
    SYSTEM_TIME = 2
    STEADY_TIME = 3
