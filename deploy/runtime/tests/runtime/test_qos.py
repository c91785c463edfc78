"""What of QoS is different from rclpy."""

from __future__ import annotations

import pytest

from rclpy import qos


def test_what_c_would_need_is_refused_by_name() -> None:
    with pytest.raises(NotImplementedError, match="get_c_qos_profile"):
        qos.qos_profile_default.get_c_qos_profile()
