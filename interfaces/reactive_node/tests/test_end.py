"""The end of a node as its observables know it."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from example_interfaces.action import Fibonacci
from reactivex import Observable
from std_msgs.msg import String
from std_srvs.srv import SetBool

from reactive_node import ReactiveNode

Create = Callable[[ReactiveNode], Observable[object]]
OBSERVABLES: dict[str, Create] = {
    "topic": lambda node: node.create_observable(String, "topic"),
    "sampled": lambda node: node.create_observable(String, "topic", sampled=0.1),
    "buffered": lambda node: node.create_observable(String, "topic", buffered=0.1),
    "parameter": lambda node: node.create_parameter_observable("use_sim_time").ignore_elements(),
    "event": lambda node: node.create_event_observable(String, "topic", 10, "matched"),
    "transform": lambda node: node.create_transform_observable("map", "arm"),
    "call": lambda node: node.create_call(SetBool, "switch")(SetBool.Request()),
    "call with timeout": lambda node: node.create_call(SetBool, "switch", timeout=1.0)(SetBool.Request()),
    "action": lambda node: node.create_action_call(Fibonacci, "action")(Fibonacci.Goal()),
}
each_kind = pytest.mark.parametrize("create", OBSERVABLES.values(), ids=OBSERVABLES)


@each_kind
def test_observable_of_ended_node_completes_at_once(node: ReactiveNode, create: Create) -> None:
    observable = create(node)
    node.destroy_node()
    ended: list[object] = []

    observable.subscribe(ended.append, ended.append, lambda: ended.append("completed"))

    assert ended == ["completed"]
