"""QoS functions of rclpy that the runtime does not implement."""

from __future__ import annotations

import pytest

from rclpy import qos


def test_get_c_qos_profile_is_not_implemented() -> None:
    with pytest.raises(NotImplementedError, match="get_c_qos_profile"):
        qos.qos_profile_default.get_c_qos_profile()
