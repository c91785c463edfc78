"""Cancelled and timed-out calls."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rclpy.node import Node
from std_srvs.srv import Trigger

FIRST = 1  # the number of a client's first request


def test_a_cancelled_call_is_forgotten(make_node: Callable[..., Node]) -> None:
    client = make_node().create_client(Trigger, "missing")
    future = client.call_async(Trigger.Request())
    assert client.get_pending_request(FIRST) is future
    future.cancel()
    with pytest.raises(KeyError):
        client.get_pending_request(FIRST)


def test_a_call_that_timed_out_is_forgotten(make_node: Callable[..., Node]) -> None:
    client = make_node().create_client(Trigger, "missing")
    client.call(Trigger.Request(), timeout_sec=0.05)
    with pytest.raises(KeyError):
        client.get_pending_request(FIRST)
