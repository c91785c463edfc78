from __future__ import annotations

import pytest
from deploy.runtime.tests.nodes import MakeNode

from rclpy._dds import WaitSet
from rclpy.context import Context
from rclpy.exceptions import RCLError
from std_srvs.srv import Trigger

FIRST = 1  # the number of a client's first request


def test_a_cancelled_call_is_forgotten(make_node: MakeNode) -> None:
    client = make_node().create_client(Trigger, "missing")
    future = client.call_async(Trigger.Request())
    assert client.get_pending_request(FIRST) is future
    future.cancel()
    with pytest.raises(KeyError):
        client.get_pending_request(FIRST)


def test_a_call_that_timed_out_is_forgotten(make_node: MakeNode) -> None:
    client = make_node().create_client(Trigger, "missing")
    client.call(Trigger.Request(), timeout_sec=0.05)
    with pytest.raises(KeyError):
        client.get_pending_request(FIRST)


def test_wait_for_service_ends_in_order_when_the_domain_is_left_meanwhile(
    make_node: MakeNode, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_node()
    client = node.create_client(Trigger, "nobody")
    wait = WaitSet.wait

    def leave(self: WaitSet, timeout: int) -> list[int]:
        context.destroy()  # as another thread may do
        return wait(self, 0)

    monkeypatch.setattr(WaitSet, "wait", leave)
    with pytest.raises(RCLError):
        client.wait_for_service(timeout_sec=5)
