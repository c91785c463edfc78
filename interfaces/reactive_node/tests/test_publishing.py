from __future__ import annotations

import gc
import weakref
from collections.abc import Callable
from typing import Any

import pytest
import reactivex as rx
from rclpy.node import Node
from reactivex.abc import DisposableBase
from reactivex.disposable import Disposable
from reactivex.subject import Subject
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool

from reactive_node import ReactiveNode
from reactive_node.testing import SpinFor, SpinUntil


def test_message_is_made_of_each_item_unless_there_is_none(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    numbers: Subject[float] = Subject()
    received: list[float] = []
    peer.create_subscription(Float64, "numbers", lambda message: received.append(message.data), 10)

    def message(number: float) -> Float64 | None:
        return Float64(data=1 / number) if number else None

    node.publish_observable(numbers, Float64, "numbers", message=message)
    spin_until(lambda: any(p.get_subscription_count() for p in node.publishers if p.topic_name == "/numbers"))
    for number in (2.0, 0.0, 4.0):
        numbers.on_next(number)
    spin_until(lambda: received == [0.5, 0.25])


def test_error_while_a_message_is_made_is_raised_once_by_spin(
    node: ReactiveNode, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    numbers: Subject[int] = Subject()
    node.publish_observable(numbers, Float64, "numbers", message=lambda number: Float64(data=1 / number))
    numbers.on_next(0)
    assert not numbers.observers
    with pytest.raises(ZeroDivisionError):
        spin_until(lambda: False)
    spin_for(0.05)


def test_observable_on_demand_is_observed_while_there_are_subscribers(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    happened: list[str] = []
    received: list[float] = []

    def subscribe(observer: Any, scheduler: Any = None) -> Disposable:
        happened.append("observed" if scheduler is node.scheduler else "another scheduler")
        observer.on_next(Float64(data=1.5))
        return Disposable(lambda: happened.append("disposed"))

    node.publish_observable(rx.Observable(subscribe), Float64, "numbers", on_demand=True)
    spin_until(lambda: peer.count_publishers("numbers") == 1)
    assert happened == []

    first = peer.create_subscription(Float64, "numbers", lambda message: received.append(message.data), 10)
    spin_until(lambda: received == [1.5])
    second = peer.create_subscription(Float64, "numbers", lambda _: None, 10)
    spin_until(lambda: node.count_subscribers("numbers") == 2)
    spin_for(0.1)  # the second one is no reason to begin again
    peer.destroy_subscription(first)
    spin_until(lambda: node.count_subscribers("numbers") == 1)
    spin_for(0.1)
    assert happened == ["observed"]
    peer.destroy_subscription(second)
    spin_until(lambda: happened[1:])
    assert happened == ["observed", "disposed"]


def test_publisher_ends_with_its_publication(node: ReactiveNode) -> None:
    ended = node.publish_observable(rx.never(), Float64, "ended")
    node.publish_observable(rx.never(), Float64, "lasting")
    ended.dispose()
    topics = {publisher.topic_name for publisher in node.publishers}
    assert topics & {"/ended", "/lasting"} == {"/lasting"}


SINKS: dict[str, Callable[[ReactiveNode], DisposableBase]] = {
    "publication": lambda node: node.publish_observable(rx.never(), Float64, "numbers"),
    "service": lambda node: node.serve_recipe(lambda requests: requests.ignore_elements(), SetBool, "switch"),
}


@pytest.mark.parametrize("create", SINKS.values(), ids=SINKS)
def test_sink_is_forgotten_after_disposal(
    node: ReactiveNode, create: Callable[[ReactiveNode], DisposableBase]
) -> None:
    sink = create(node)
    disposed = weakref.ref(sink)

    sink.dispose()
    del sink
    gc.collect()

    assert disposed() is None


def test_ended_node_leaves_the_graph_and_drops_its_actions(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    def act(*_: Any) -> None:
        pass

    dropped = weakref.ref(act)
    node.scheduler.schedule_relative(60.0, act)
    del act
    spin_until(lambda: "reactive" in peer.get_node_names())

    node.destroy_node()
    gc.collect()

    assert dropped() is None
    spin_until(lambda: "reactive" not in peer.get_node_names())


def test_ten_messages_wait_unless_the_user_wants_otherwise(node: ReactiveNode) -> None:
    node.create_observable(Float64, "heard").subscribe()
    node.publish_observable(rx.never(), Float64, "said")
    endpoints = [*node.subscriptions, *node.publishers]
    depths = {endpoint.topic_name: endpoint.qos_profile.depth for endpoint in endpoints}

    assert (depths["/heard"], depths["/said"]) == (10, 10)


@pytest.mark.parametrize(
    "recipe",
    [
        rx.throw(ValueError("planted")),
        rx.timer(0.01).map(lambda _: int("planted")),
        rx.timer(0.01).flat_map(lambda _: rx.of(1).map(lambda _: int("planted"))),
        rx.timer(0.01).map(lambda _: rx.throw(ValueError("planted"))).switch_latest(),
    ],
)
def test_error_in_recipe_is_raised_by_spin(
    node: ReactiveNode, spin_until: SpinUntil, recipe: rx.Observable[Any]
) -> None:
    node.publish_observable(recipe, Float64, "numbers")

    with pytest.raises(ValueError, match="planted"):
        spin_until(lambda: False)


@pytest.mark.parametrize("message", [String(data="no number"), None], ids=["string", "none"])
def test_message_of_wrong_type_is_raised_by_spin(
    node: ReactiveNode, spin_until: SpinUntil, message: Any
) -> None:
    node.publish_observable(rx.timer(0.01).map(lambda _: message), Float64, "numbers")

    with pytest.raises(TypeError):
        spin_until(lambda: False)
