"""What these message_filters do better than those of ROS 2, and what they cost."""

from __future__ import annotations

import subprocess
import sys

import pytest
from sensor_msgs.msg import Imu

from message_filters import SimpleFilter, TimeSynchronizer

pytestmark = pytest.mark.own


def test_the_callback_of_a_synchronizer_may_feed_it() -> None:
    inputs = [SimpleFilter(), SimpleFilter()]
    stamps: list[int] = []

    def imu(second: int) -> Imu:
        message = Imu()
        message.header.stamp.sec = second
        return message

    def feed_next(left: Imu, _: Imu) -> None:
        stamps.append(left.header.stamp.sec)
        if len(stamps) < 3:
            for source in inputs:
                source.signalMessage(imu(left.header.stamp.sec + 1))

    TimeSynchronizer(inputs, 5).registerCallback(feed_next)
    for source in inputs:
        source.signalMessage(imu(1))
    assert stamps == [1, 2, 3]


def test_programs_without_tf2_do_not_load_it() -> None:
    program = "import message_filters, sys; print([name for name in sys.modules if 'tf2' in name])"
    found = subprocess.check_output([sys.executable, "-c", program], text=True, timeout=30)
    assert found == "[]\n"
