from __future__ import annotations

from collections.abc import Callable

import pytest
import reactivex as rx
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from reactivex import Observable
from reactivex.subject import Subject
from std_msgs.msg import String
from std_srvs.srv import SetBool

from interfaces.reactive_node.tests.fibonacci import Fibonacci
from reactive_node import ReactiveNode
from reactive_node.end import End

Create = Callable[[ReactiveNode], Observable[object]]
OBSERVABLES: dict[str, Create] = {
    "topic": lambda node: node.create_observable(String, "topic"),
    "sampled": lambda node: node.create_sampled_observable(String, "topic", 0.1),
    "buffered": lambda node: node.create_buffered_observable(String, "topic", 0.1),
    "parameter": lambda node: node.create_parameter_observable("use_sim_time").ignore_elements(),
    "event": lambda node: node.create_event_observable(String, "topic", 10, "matched"),
    "call": lambda node: node.create_call(SetBool, "switch")(SetBool.Request()),
    "call with timeout": lambda node: node.create_call(SetBool, "switch", timeout=1.0)(SetBool.Request()),
    "action": lambda node: node.create_action_call(Fibonacci, "action")(Fibonacci.Goal()),
}
each_kind = pytest.mark.parametrize("create", OBSERVABLES.values(), ids=OBSERVABLES)


class Watch:
    """Keeps how an observable ends, and may raise then."""

    def __init__(self, observable: Observable[object], error: str = "") -> None:
        self.ended: list[object] = []
        self._error = error
        observable.subscribe(self.ended.append, self.ended.append, self._complete)

    def _complete(self) -> None:
        self.ended.append("completed")
        if self._error:
            raise ValueError(self._error)


@each_kind
def test_observer_that_raises_keeps_no_other_from_its_end(node: ReactiveNode, create: Create) -> None:
    observable, other = create(node), node.create_observable(String, "other")
    watches = [Watch(observable, "first"), Watch(observable, "second"), Watch(observable), Watch(other)]

    with pytest.raises(ValueError, match="first"):
        node.destroy_node()

    assert [watch.ended for watch in watches] == [["completed"]] * 4


def test_node_ends_although_an_observer_raises(node: ReactiveNode, peer: Node) -> None:
    numbers: Subject[String] = Subject()
    node.publish_observable(numbers, String, "numbers")
    Watch(node.create_observable(String, "topic"), "planted")

    with pytest.raises(ValueError, match="planted"):
        node.destroy_node()
    node.destroy_node()

    assert not numbers.observers
    assert not list(node.subscriptions)
    assert not list(node.timers)


def test_recipe_that_fails_at_its_end_keeps_no_other_from_its_end(node: ReactiveNode) -> None:
    ended: list[str] = []

    def end(name: str) -> Callable[[], None]:
        def fail() -> None:
            ended.append(name)
            raise ValueError(name)

        return fail

    for name in ("first", "second"):
        node.publish_observable(Subject[String]().finally_action(end(name)), String, name)

    with pytest.raises(ValueError, match="second"):
        node.destroy_node()

    assert ended == ["first", "second"]


@each_kind
def test_observable_of_ended_node_completes_at_once(node: ReactiveNode, create: Create) -> None:
    observable = create(node)
    node.destroy_node()

    assert Watch(observable).ended == ["completed"]


def test_source_is_observed_until_the_end_and_never_after() -> None:
    end, source, heard = End(), Subject[int](), list[object]()

    def begin(_: object) -> Observable[int]:
        heard.append("begin")
        return source

    limited = end.limit(rx.defer(begin))
    limited.subscribe(heard.append)
    source.on_next(1)
    end.come()
    limited.subscribe(heard.append)

    assert heard == ["begin", 1]
    assert not source.observers


def test_node_ends_without_an_error_although_a_signal_ends_its_context(
    node: ReactiveNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    wait = Publisher.wait_for_all_acked

    def wait_after_a_signal(publisher: Publisher, timeout: Duration) -> bool:
        node.context.try_shutdown()
        return wait(publisher, timeout)

    monkeypatch.setattr(Publisher, "wait_for_all_acked", wait_after_a_signal)
    watch = Watch(node.create_observable(String, "topic"))
    node.destroy_node()
    assert watch.ended == ["completed"]


def test_readers_have_a_tenth_of_a_second_together_for_the_last_messages(
    node: ReactiveNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("first", "second", "third"):
        node.publish_observable(Subject[String](), String, name)
    now, waited = 10.0, list[float]()

    def wait(_: Publisher, timeout: Duration) -> None:
        nonlocal now
        now += 0.06
        waited.append(timeout.nanoseconds / 1e9)

    monkeypatch.setattr("reactive_node.node.time.monotonic", lambda: now)
    monkeypatch.setattr(Publisher, "wait_for_all_acked", wait)
    node.destroy_node()

    assert waited[:3] == pytest.approx([0.1, 0.04, 0.0])


@pytest.mark.parametrize("name", ["scheduler", "steady_scheduler"])
def test_nothing_stays_scheduled_after_the_end_of_the_node(node: ReactiveNode, name: str) -> None:
    scheduler = getattr(node, name)
    scheduler.schedule_relative(60.0, lambda *_: None)
    assert scheduler.kept == 1
    node.destroy_node()
    assert scheduler.kept == 0


def test_recipe_that_begins_at_the_end_of_the_node_ends_too(node: ReactiveNode) -> None:
    numbers: Subject[String] = Subject()
    early: Subject[String] = Subject()

    def begin() -> None:
        node.publish_observable(numbers, String, "numbers")

    node.publish_observable(early.finally_action(begin), String, "early")
    node.destroy_node()

    assert not numbers.observers
