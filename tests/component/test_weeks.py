"""What services do for weeks leaves nothing behind."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from rclpy.node import Node

from interfaces import topics
from interfaces.reactive_node.tests.leftovers import assert_nothing_is_left
from interfaces.service import ServiceNode

Make = Callable[..., Any]
SpinUntil = Callable[..., None]
SpinFor = Callable[[float], None]


@pytest.mark.timeout(120)
def test_nothing_is_left_of_reports_of_health(
    make_node: Make, spin_until: SpinUntil, spin_for: SpinFor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("interfaces.service.health.PERIOD", 3600.0)
    service, peer = make_node("service", kind=ServiceNode), make_node("peer", kind=Node)
    topic = topics.DIAGNOSTICS
    heard: list[Any] = []
    peer.create_subscription(topic.type, topic.name, heard.append, topic.qos)
    spin_until(lambda: heard)  # the report to a new subscriber

    def report() -> None:
        heard.clear()
        service.health.drop("subject", "a reason with 1.5")
        service.health.on_period()
        spin_until(lambda: heard)

    assert_nothing_is_left(report, lambda: spin_for(0.1))
