from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Callable
from typing import Any

import pytest
import reactivex as rx
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from reactivex.abc import DisposableBase
from reactivex.subject import AsyncSubject
from std_msgs.msg import String

from reactive_node import ReactiveNode
from reactive_node.shared_reader import SharedReader
from reactive_node.testing import SpinFor, SpinUntil

LATCHED = QoSProfile(depth=3, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Talker:
    def __init__(self, peer: Node, spin_until: SpinUntil, qos: QoSProfile | int = 10) -> None:
        self.publisher: Publisher = peer.create_publisher(String, "topic", qos)
        self.spin_until = spin_until

    def say(self, *texts: str) -> None:
        for text in texts:
            self.publisher.publish(String(data=text))

    def say_when_heard(self, *texts: str) -> None:
        self.spin_until(lambda: self.publisher.get_subscription_count() == 1)
        self.say(*texts)


@pytest.fixture
def talker(peer: Node, spin_until: SpinUntil) -> Talker:
    return Talker(peer, spin_until)


@pytest.fixture
def latched_talker(peer: Node, spin_until: SpinUntil) -> Talker:
    return Talker(peer, spin_until, LATCHED)


def texts_into(received: list[str]) -> Callable[[Any], None]:
    return lambda message: received.append(message.data)


# Cold and shared


def test_no_reader_exists_before_first_observer(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    observable = node.create_observable(String, "topic")
    spin_for(0.2)
    assert talker.publisher.get_subscription_count() == 0
    assert not [sub for sub in node.subscriptions if sub.topic_name == "/topic"]

    observable.subscribe()
    spin_until(lambda: talker.publisher.get_subscription_count() == 1)


def test_observers_share_one_reader_until_last_one_leaves(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    received: dict[int, list[str]] = {0: [], 1: [], 2: []}
    observable = node.create_observable(String, "topic")
    subscriptions = [observable.subscribe(texts_into(received[n])) for n in received]

    talker.say_when_heard("all")
    spin_until(lambda: all(received.values()))
    spin_for(0.05)
    assert talker.publisher.get_subscription_count() == 1
    subscriptions[0].dispose()
    talker.say("two of us")
    spin_until(lambda: len(received[2]) == 2)
    subscriptions[1].dispose()
    subscriptions[2].dispose()
    spin_until(lambda: talker.publisher.get_subscription_count() == 0)

    assert received == {0: ["all"], 1: ["all", "two of us"], 2: ["all", "two of us"]}


@pytest.mark.parametrize("timestamped", [False, True])
def test_late_observer_of_latched_topic_gets_retained_samples(
    node: ReactiveNode,
    latched_talker: Talker,
    spin_until: SpinUntil,
    spin_for: SpinFor,
    timestamped: bool,
) -> None:
    def messages() -> rx.Observable[String]:
        item = (lambda it: it.value) if timestamped else None
        return node.create_observable(String, "topic", LATCHED, timestamped=timestamped, item=item)

    shared, own = messages(), messages()
    first: list[str] = []
    late: list[str] = []
    late_with_own: list[str] = []
    latched_talker.say("0", "1", "2", "3")
    shared.subscribe(texts_into(first))
    spin_until(lambda: first == ["1", "2", "3"])
    latched_talker.say("4")
    spin_until(lambda: first[-1] == "4")

    shared.subscribe(texts_into(late))
    own.subscribe(texts_into(late_with_own))
    assert late == []  # the executor delivers them, like all messages
    spin_until(lambda: len(late) == 3 and len(late_with_own) == 3)
    latched_talker.say("5")
    spin_until(lambda: late[-1] == "5" and late_with_own[-1] == "5")
    spin_for(0.05)

    assert late == late_with_own == ["2", "3", "4", "5"]
    assert first == ["1", "2", "3", "4", "5"]


def test_node_forgets_a_reader_that_has_gone(node: ReactiveNode) -> None:
    known = node.default_callback_group.entities
    before = len(known)
    observed = node.create_observable(String, "topic").subscribe()
    assert len(known) > before
    observed.dispose()
    gc.collect()
    assert len(known) == before


def test_volatile_publishers_of_a_latched_topic_are_read_only_if_wanted(
    node: ReactiveNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    create = node.create_subscription
    notices: list[bool] = []

    def create_subscription(*arguments: Any, **options: Any) -> Any:
        notices.append("event_callbacks" in options)
        return create(*arguments, **options)

    monkeypatch.setattr(node, "create_subscription", create_subscription)
    node.create_observable(String, "topic", LATCHED).subscribe()
    node.create_observable(String, "topic", LATCHED, every_publisher=True).subscribe()

    assert notices == [False, True]


def test_retained_samples_end_with_their_publisher(
    node: ReactiveNode, peer: Node, latched_talker: Talker, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    observable = node.create_observable(String, "topic", LATCHED)
    first: list[str] = []
    late: list[str] = []
    observable.subscribe(texts_into(first))
    latched_talker.say("0")
    spin_until(lambda: first == ["0"])

    peer.destroy_publisher(latched_talker.publisher)
    spin_until(lambda: node.count_publishers("topic") == 0)
    observable.subscribe(texts_into(late))
    spin_for(0.1)

    assert late == []


def test_new_reader_forgets_samples_of_previous_one(
    node: ReactiveNode, latched_talker: Talker, spin_until: SpinUntil
) -> None:
    deep = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    observable = node.create_observable(String, "topic", deep)
    latched_talker.say("0", "1")
    for _ in range(2):
        first: list[str] = []
        late: list[str] = []
        subscriptions = [observable.subscribe(texts_into(first))]
        spin_until(lambda first=first: first == ["0", "1"])
        subscriptions.append(observable.subscribe(texts_into(late)))
        spin_until(lambda late=late: late == ["0", "1"])
        for subscription in subscriptions:
            subscription.dispose()


def test_observer_that_leaves_early_gets_no_retained_samples(
    node: ReactiveNode, latched_talker: Talker, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    observable = node.create_observable(String, "topic", LATCHED)
    first: list[str] = []
    late: list[str] = []
    observable.subscribe(texts_into(first))
    latched_talker.say("0")
    spin_until(lambda: first)

    take = texts_into(late)
    forgotten = weakref.ref(take)
    observable.subscribe(take).dispose()
    del take
    spin_for(0.05)
    gc.collect()

    assert late == []
    assert forgotten() is None


def test_late_observer_of_keep_all_topic_gets_every_sample(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    everything = QoSProfile(
        history=HistoryPolicy.KEEP_ALL, depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL
    )
    observable = node.create_observable(String, "topic", everything)
    first: list[str] = []
    late: list[str] = []
    observable.subscribe(texts_into(first))
    Talker(peer, spin_until, everything).say("0", "1", "2")
    spin_until(lambda: first == ["0", "1", "2"])

    observable.subscribe(texts_into(late))
    spin_until(lambda: late == ["0", "1", "2"])


def test_reader_that_is_gone_waits_for_no_end_of_the_node(node: ReactiveNode, spin_until: SpinUntil) -> None:
    end: AsyncSubject[None] = AsyncSubject()
    reader = SharedReader(
        node,
        lambda callback: node.create_subscription(String, "topic", callback, 10),
        scheduler=node.scheduler,
        end=end,
    )
    subscription = rx.Observable(reader.subscribe).subscribe()
    assert len(end.observers) == 1
    subscription.dispose()
    assert end.observers == []


def test_invalid_message_type_is_error_of_observable(node: ReactiveNode) -> None:
    errors: list[Exception] = []

    observable = node.create_observable(int, "topic")
    observable.subscribe(on_error=errors.append)
    observable.subscribe(on_error=errors.append)

    assert [type(error) for error in errors] == [AttributeError, AttributeError]


# Disposing anywhere


def test_disposing_in_callback_stops_messages(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    received: list[str] = []
    subscription: DisposableBase

    def take(message: String) -> None:
        received.append(message.data)
        subscription.dispose()

    subscription = node.create_observable(String, "topic").subscribe(take)
    talker.say_when_heard("0", "1", "2")
    spin_until(lambda: talker.publisher.get_subscription_count() == 0)
    spin_for(0.05)

    assert received == ["0"]


def test_observer_that_leaves_in_its_callback_hides_no_message_from_others(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil
) -> None:
    received: list[str] = []
    leaving: DisposableBase
    observable = node.create_observable(String, "topic")
    leaving = observable.subscribe(lambda _: leaving.dispose())
    observable.subscribe(texts_into(received))
    talker.say_when_heard("0", "1")
    spin_until(lambda: received[-1:] == ["1"])

    assert received == ["0", "1"]


def test_thousand_disposals_on_other_threads_under_traffic_are_safe(
    node: ReactiveNode, latched_talker: Talker, spin_until: SpinUntil
) -> None:
    observable = node.create_observable(String, "topic", LATCHED)
    kept = observable.subscribe()
    node.create_timer(0.0005, lambda: latched_talker.say("noise"))
    done = threading.Event()
    errors: list[BaseException] = []

    def churn() -> None:
        try:
            for round_ in range(500):
                subscription = observable.subscribe(lambda _: None)
                if round_ % 5 == 0:
                    kept_for_a_while = node.create_observable(String, "topic").subscribe(lambda _: None)
                    kept_for_a_while.dispose()
                subscription.dispose()
        except BaseException as error:
            errors.append(error)
        finally:
            done.set()

    threads = [threading.Thread(target=churn) for _ in range(2)]
    for thread in threads:
        thread.start()
    spin_until(lambda: not any(thread.is_alive() for thread in threads), seconds=30)
    kept.dispose()

    assert errors == []
    assert not [sub for sub in node.subscriptions if sub.topic_name == "/topic"]


# Errors


def test_observable_can_be_subscribed_after_its_reader_failed(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    received: list[str] = []
    observable = node.create_observable(String, "topic")
    with monkeypatch.context() as patch:
        patch.setattr(node, "create_subscription", lambda *_, **__: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            observable.subscribe(texts_into(received))

    observable.subscribe(texts_into(received))

    talker.say_when_heard("heard")
    spin_until(lambda: received == ["heard"])


@pytest.mark.parametrize(
    "subscribe",
    [lambda it: it.subscribe(lambda _: 1 / 0), lambda it: it.map(lambda _: 1 / 0).subscribe()],
    ids=["observer", "operator"],
)
def test_unobserved_error_is_raised_by_spin(
    node: ReactiveNode,
    talker: Talker,
    spin_until: SpinUntil,
    subscribe: Callable[[rx.Observable[String]], DisposableBase],
) -> None:
    subscribe(node.create_observable(String, "topic"))

    talker.say_when_heard("boom")
    with pytest.raises(ZeroDivisionError):
        spin_until(lambda: False)
