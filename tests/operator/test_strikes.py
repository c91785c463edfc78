"""How many strikes are left, when operator watchdogs come and go."""

from __future__ import annotations

from typing import Any

import pytest
from rclpy.node import Node

from deploy.operator.strikes import new_watchdogs
from interfaces.topics import OPERATOR_ACTIVITY
from reactive_node import ReactiveNode
from reactive_node.testing import MakeNode, SpinUntil


def test_watchdog_that_has_gone_begins_no_new_strikes(
    make_node: MakeNode, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    display: ReactiveNode = make_node("display", kind=ReactiveNode)
    changes: list[int] = []
    create = display.create_event_observable

    def noted(*given: Any) -> Any:
        return create(*given).do_action(lambda it: changes.append(it.current_count_change))

    monkeypatch.setattr(display, "create_event_observable", noted)
    found: list[bool] = []
    new_watchdogs(display, first_is_new=False).subscribe(found.append)

    def start(name: str) -> Node:
        node: Node = make_node(name, kind=Node)
        node.create_publisher(OPERATOR_ACTIVITY.type, OPERATOR_ACTIVITY.name, OPERATOR_ACTIVITY.qos)
        return node

    killed = start("killed")
    spin_until(lambda: changes == [1])
    start("successor")  # DDS notices a killed process some seconds after the start of its successor
    spin_until(lambda: changes == [1, 1])
    killed.destroy_node()
    spin_until(lambda: changes == [1, 1, -1])

    assert found == [False, True]
