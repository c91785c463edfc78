"""Topics that are read by the clock, not when a message arrives."""

from __future__ import annotations

import threading
import time
from functools import partial
from typing import Any
from unittest import mock

import pytest
import reactivex as rx
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from reactivex.subject import Subject
from std_msgs.msg import Float64, String

from reactive_node import ReactiveNode
from reactive_node.sampled_reader import Polled, sampled_messages
from reactive_node.testing import SpinUntil, VirtualTime

NOW = None  # an item of the ticks


class Talker:
    """Publishes numbers that the peer's own reader has heard when `say` returns."""

    def __init__(self, peer: Node, spin_until: SpinUntil) -> None:
        self.publisher = peer.create_publisher(Float64, "topic", 10)
        self._heard: list[float] = []
        peer.create_subscription(Float64, "topic", lambda message: self._heard.append(message.data), 10)
        self._spin_until = spin_until
        self.await_readers(1)

    def await_readers(self, count: int) -> None:
        self._spin_until(lambda: self.publisher.get_subscription_count() == count)

    def say(self, *numbers: float) -> None:
        self._heard.clear()
        for number in numbers:
            self.publisher.publish(Float64(data=number))
        self._spin_until(lambda: self._heard == list(numbers))


@pytest.fixture
def talker(peer: Node, spin_until: SpinUntil) -> Talker:
    return Talker(peer, spin_until)


@pytest.fixture
def ticks() -> Subject[None]:
    return Subject()


def test_tick_reads_the_newest_message_once(
    node: ReactiveNode, talker: Talker, ticks: Subject[None], spin_until: SpinUntil
) -> None:
    received: list[float] = []
    topic = node.create_sampled_observable(Float64, "topic", ticks)
    topic.map(lambda message: message.data).subscribe(received.append)
    talker.await_readers(2)

    ticks.on_next(NOW)
    assert received == []
    talker.say(1.0, 2.0, 3.0)
    assert received == [], "nothing is read between two ticks"
    spin_until(lambda: ticks.on_next(NOW) or received)
    assert received == [3.0]
    ticks.on_next(NOW)
    assert received == [3.0]
    talker.say(4.0)
    spin_until(lambda: ticks.on_next(NOW) or received[1:])
    assert received == [3.0, 4.0]


def test_tick_of_a_buffer_reads_all_messages_once(
    node: ReactiveNode, talker: Talker, ticks: Subject[None], spin_until: SpinUntil
) -> None:
    received: list[float] = []
    topic = node.create_buffered_observable(Float64, "topic", ticks, 3)
    topic.map(lambda message: message.data).subscribe(received.append)
    talker.await_readers(2)

    talker.say(1.0, 2.0)
    assert received == [], "nothing is read between two ticks"
    numbers = [1.0, 2.0, *map(float, range(8))]
    for number in numbers[2:]:
        talker.publisher.publish(Float64(data=number))
    reads: list[int] = []
    spin_until(lambda: ticks.on_next(NOW) or reads.append(len(received)) or len(received) == len(numbers))
    ticks.on_next(NOW)
    assert received == numbers
    assert len(set(reads)) < len(numbers), "a tick reads many"


def test_reader_that_may_have_lost_messages_is_known(node: ReactiveNode, ticks: Subject[None]) -> None:
    waiting: list[Any] = []
    subscription = mock.MagicMock(topic_name="/topic")
    subscription.handle.take_message.side_effect = lambda *_: waiting.pop() if waiting else None
    full: list[int] = []
    with mock.patch.object(node, "create_subscription", return_value=subscription):
        topic = node.create_buffered_observable(Float64, "topic", ticks, on_full=lambda: full.append(reads))
        topic.subscribe()
        for reads in (0, 999, 1000, 5, 1000):
            waiting[:] = [(Float64(), {})] * reads
            ticks.on_next(NOW)
    assert full == [1000, 1000]


def test_period_ticks_at_once_and_by_the_scheduler_of_the_node(
    node: ReactiveNode, scheduler: VirtualTime
) -> None:
    subscription = mock.MagicMock(topic_name="/topic")
    subscription.handle.take_message.return_value = (Float64(), {"source_timestamp": 0})
    reads: list[float] = []
    with mock.patch.multiple(node, create_subscription=lambda *_, **__: subscription, scheduler=scheduler):
        topic = node.create_sampled_observable(Float64, "topic", 0.2)
        topic.subscribe(lambda _: reads.append(scheduler.clock))
        scheduler.advance_to(0.5)
    assert reads == pytest.approx([0.0, 0.2, 0.4])


def test_last_observer_ends_the_ticks_and_the_reader(
    node: ReactiveNode, talker: Talker, ticks: Subject[None]
) -> None:
    topic = node.create_sampled_observable(Float64, "topic", ticks)
    for _ in range(2):
        assert not ticks.observers
        talker.await_readers(1)  # its own
        observers = [topic.subscribe() for _ in range(2)]
        talker.await_readers(2)
        for observer in observers:
            assert ticks.observers
            observer.dispose()


@pytest.mark.parametrize("end", ["on_completed", "on_error"])
def test_end_of_the_ticks_is_its_end(node: ReactiveNode, ticks: Subject[None], end: str) -> None:
    ended: list[str] = []
    node.create_sampled_observable(Float64, "topic", ticks).subscribe(
        on_error=lambda _: ended.append("on_error"), on_completed=lambda: ended.append("on_completed")
    )
    assert list(node.subscriptions)
    getattr(ticks, end)(*([ValueError()] if end == "on_error" else []))
    assert ended == [end]
    assert not [each for each in node.subscriptions if each.topic_name == "/topic"]


@pytest.mark.parametrize("end", ["on_completed", "on_error"])
@pytest.mark.parametrize("ends_at_once", [True, False])
def test_topic_is_read_again_after_the_end_of_the_ticks(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil, end: str, ends_at_once: bool
) -> None:
    last: Subject[None] = Subject()
    first: Subject[None] = Subject()
    remaining = [first, last]
    topic = node.create_sampled_observable(Float64, "topic", rx.defer(lambda _: remaining.pop(0)))
    received: list[float] = []
    again = topic.catch(lambda _, source: source) if end == "on_error" else topic.concat(topic)
    give_end = partial(getattr(first, end), *([ValueError()] if end == "on_error" else []))
    if ends_at_once:
        give_end()
    again.subscribe(lambda message: received.append(message.data))
    if not ends_at_once:
        give_end()
    talker.await_readers(2)
    talker.say(1.0)
    spin_until(lambda: last.on_next(NOW) or received)
    assert received == [1.0]


@pytest.mark.parametrize("how", ["sampled", "buffered"])
def test_retry_reads_on_after_an_error_of_the_item(
    node: ReactiveNode, talker: Talker, ticks: Subject[None], spin_until: SpinUntil, how: str
) -> None:
    create = getattr(node, f"create_{how}_observable")
    received: list[float] = []
    errors: list[Exception] = []
    topic = create(Float64, "topic", ticks, item=lambda message: 1.0 / message.data)
    topic.do_action(on_error=errors.append).retry().subscribe(received.append)
    talker.await_readers(2)
    talker.say(0.0)
    spin_until(lambda: ticks.on_next(NOW) or errors)
    spin_until(lambda: talker.publisher.publish(Float64(data=2.0)) or ticks.on_next(NOW) or received)
    assert received[0] == 0.5
    assert [type(error) for error in errors] == [ZeroDivisionError]


def test_reader_that_cannot_be_created_is_an_error_of_each_observer(
    node: ReactiveNode, ticks: Subject[None]
) -> None:
    errors: list[Exception] = []
    topic = node.create_sampled_observable(int, "topic", ticks)
    topic.subscribe(on_error=errors.append)
    topic.subscribe(on_error=errors.append)
    assert [type(error) for error in errors] == [AttributeError, AttributeError]
    assert errors[0] is not errors[1], "each observer tries again"


@pytest.mark.parametrize("period", [0.0, -1, float("nan"), float("inf")])
@pytest.mark.parametrize("how", ["sampled", "buffered"])
def test_period_must_be_a_positive_number(node: ReactiveNode, how: str, period: float) -> None:
    with pytest.raises(ValueError, match=f"^topic: a period of {period} s is no positive number$"):
        getattr(node, f"create_{how}_observable")(Float64, "topic", period)


def test_other_thread_may_dispose_while_it_is_read(node: ReactiveNode, talker: Talker) -> None:
    for _ in range(50):
        ticks: Subject[None] = Subject()
        subscription = node.create_sampled_observable(Float64, "topic", ticks).subscribe()
        reader = threading.Thread(target=lambda ticks=ticks: [ticks.on_next(NOW) for _ in range(20)])
        reader.start()
        subscription.dispose()
        reader.join()


def test_refused_message_is_reported_and_the_next_one_read(ticks: Subject[None]) -> None:
    """Not every middleware refuses the same messages, so a reader of the test does."""
    good = String(data="good"), {"source_timestamp": 7}
    taken = mock.Mock(side_effect=[RuntimeError("no String"), good, None])
    subscription = mock.MagicMock(topic_name="/text", handle=mock.MagicMock(take_message=taken))
    warnings: list[str] = []
    stub = mock.Mock()
    stub.get_logger.return_value.warning = warnings.append
    received: list[Any] = []
    read = sampled_messages(stub, lambda **_: subscription, ticks, timestamped=True, most=5)
    read.subscribe(received.append)
    ticks.on_next(NOW)
    assert warnings == ["/text: no String"]
    assert [(it.value, it.nanoseconds) for it in received] == [(String(data="good"), 7)]
    assert taken.mock_calls == 3 * [mock.call(subscription.msg_type, subscription.raw)]


def test_reading_goes_on_after_a_malformed_message(
    node: ReactiveNode, peer: Node, ticks: Subject[None], spin_until: SpinUntil
) -> None:
    received: list[Any] = []
    node.create_sampled_observable(String, "text", ticks).subscribe(received.append)
    publisher = peer.create_publisher(String, "text", 10)
    spin_until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(b"\x00\x01\x00\x00\xff\xff\xff\x7f")
    ticks.on_next(NOW)
    publisher.publish(String(data="good"))
    spin_until(lambda: ticks.on_next(NOW) or (received and received[-1].data == "good"))


def test_flood_wakes_no_executor(
    node: ReactiveNode, talker: Talker, ticks: Subject[None], executor: SingleThreadedExecutor
) -> None:
    node.create_sampled_observable(Float64, "topic", ticks).subscribe()
    talker.await_readers(2)
    (subscription,) = (each for each in node.subscriptions if each.topic_name == "/topic")
    subscription.callback = lambda _: pytest.fail("the executor has taken a message")
    talker.say(*map(float, range(10)))
    executor.spin_once(timeout_sec=0.1)
    used = time.process_time()
    spins = 0
    end = time.monotonic() + 0.5
    while time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
        spins += 1
    assert spins < 20, "an unread message ends no wait"
    assert time.process_time() - used < 0.25


def test_no_executor_may_run_an_unattended_entity() -> None:
    group = Polled()
    assert not group.can_execute(mock.Mock())
    assert not group.beginning_execution(mock.Mock())


def test_ticks_of_the_user_run_on_the_scheduler_of_the_observer(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil
) -> None:
    threads: list[int] = []
    topic = node.create_sampled_observable(Float64, "topic", rx.interval(0.01))
    topic.subscribe(lambda _: threads.append(threading.get_ident()), scheduler=node.scheduler)
    talker.await_readers(2)
    spin_until(lambda: talker.publisher.publish(Float64()) or threads)
    assert set(threads) == {threading.get_ident()}


def test_reader_keeps_the_other_policies_of_its_topic_and_has_no_events(
    node: ReactiveNode, ticks: Subject[None]
) -> None:
    qos = QoSProfile(
        depth=7,
        history=HistoryPolicy.KEEP_ALL,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )
    node.create_sampled_observable(Float64, "topic", ticks, qos).subscribe()
    (subscription,) = (each for each in node.subscriptions if each.topic_name == "/topic")
    used = subscription.qos_profile
    assert (used.history, used.depth) == (HistoryPolicy.KEEP_LAST, 1)
    assert (used.reliability, used.durability) == (qos.reliability, qos.durability)
    assert (qos.history, qos.depth) == (HistoryPolicy.KEEP_ALL, 7)
    assert list(subscription.event_handlers) == [], "with Fast DDS, they would end each wait at once"
