"""Who is present on the graph, for the explanation why the engines are off."""

from __future__ import annotations

import pytest
from std_msgs.msg import String

from deploy.operator.engines import graph
from deploy.supervision import manifest
from interfaces.topics import ENGINES, ENGINES_STATE
from reactive_node import ReactiveNode
from reactive_node.testing import MakeNode, SpinUntil


def test_services_of_another_host_are_no_strangers(
    make_node: MakeNode, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(manifest.VARIABLE, "")
    for name in ("operator_watchdog", "rqt"):
        make_node(name).create_publisher(String, ENGINES.name, ENGINES.qos)
    viewer = make_node("viewer", kind=ReactiveNode)
    viewer.create_publisher(String, ENGINES.name, ENGINES.qos)
    spin_until(lambda: viewer.count_publishers(ENGINES.name) == 3)

    with manifest.chosen("", host="operator"):
        assert graph(viewer).strangers() == {"rqt"}


def test_each_life_of_the_controller_is_another_one(make_node: MakeNode, spin_until: SpinUntil) -> None:
    def controller() -> ReactiveNode:
        node = make_node("engine_controller", kind=ReactiveNode)
        node.create_publisher(String, ENGINES_STATE.name, ENGINES_STATE.qos)
        return node

    controllers = graph(make_node("viewer", kind=ReactiveNode)).controllers
    first = controller()
    spin_until(controllers)
    before = controllers()
    first.destroy_node()
    controller()
    spin_until(lambda: len(controllers()) == 1 and controllers() != before)
