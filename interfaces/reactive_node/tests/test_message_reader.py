from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import pytest
import reactivex as rx
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from reactivex.scheduler import ImmediateScheduler
from reactivex.subject import Subject
from std_msgs.msg import Float64

from reactive_node import ReactiveNode, message_reader
from reactive_node.end import End
from reactive_node.message_reader import MessageReader
from reactive_node.testing import SpinFor, SpinUntil

LATCHED = QoSProfile(depth=3, durability=DurabilityPolicy.TRANSIENT_LOCAL)
VOLATILE = DurabilityPolicy.VOLATILE


class Reader:
    def __init__(self, callback: Callable[..., None]) -> None:
        self.callback = callback

    @property
    def collects_info(self) -> bool:
        """Whether rclpy collects the info of each message for the callback."""
        return len(inspect.signature(self.callback).parameters) == 2


class Readers:
    def __init__(self) -> None:
        self.created: list[Reader] = []
        self.qos: list[Any] = []
        self.events: list[SubscriptionEventCallbacks | None] = []
        self.destroyed: list[Reader] = []

    def create(self, callback: Any, qos: Any, event_callbacks: Any = None) -> Reader:
        self.created.append(Reader(callback))
        self.qos.append(qos)
        self.events.append(event_callbacks)
        return self.created[-1]

    def destroy_subscription(self, reader: Reader) -> None:
        self.destroyed.append(reader)

    def find_volatile_publisher(self) -> None:
        """Report to the first reader that there is a publisher that it does not match."""
        events = self.events[0]
        assert events is not None
        assert events.incompatible_qos is not None
        events.incompatible_qos(None)  # type: ignore[arg-type]

    def receive(self, number: int, message: str, time: int) -> None:
        reader = self.created[number]
        arguments = (message, {"source_timestamp": time}) if reader.collects_info else (message,)
        reader.callback(*arguments)

    def observable(self, qos: Any, **options: Any) -> rx.Observable[Any]:
        here: Any = self
        options = {"timestamped": False, "item": None, "every_publisher": False} | options
        reader = MessageReader(here, here.create, qos, scheduler=ImmediateScheduler(), end=End(), **options)
        return rx.Observable(reader.subscribe)


@pytest.fixture
def readers() -> Readers:
    return Readers()


def half(message: Float64) -> float | None:
    return message.data / 2 if message.data > 0 else None


# Items


def test_item_is_made_once_for_all_observers(readers: Readers) -> None:
    made: list[str] = []
    received: list[tuple[str, str]] = []

    def item(message: str) -> str | None:
        made.append(message)
        return None if message == "b" else message.upper()

    observable = readers.observable(10, item=item)
    for name in ("one", "two"):
        observable.subscribe(lambda value, name=name: received.append((name, value)))
    for message in "abc":
        readers.receive(0, message, 1)

    assert received == [("one", "A"), ("two", "A"), ("one", "C"), ("two", "C")]
    assert made == [*"abc"]


def test_item_may_be_made_of_a_timestamp(readers: Readers) -> None:
    received: list[Any] = []
    observable = readers.observable(10, timestamped=True, item=lambda it: (it.value, it.nanoseconds))
    observable.subscribe(received.append)
    readers.receive(0, "a", 7)
    assert received == [("a", 7)]


@pytest.mark.parametrize("reading", ["sampled", "buffered"])
def test_tick_makes_items(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil, spin_for: SpinFor, reading: str
) -> None:
    ticks: Subject[None] = Subject()
    received: list[Any] = []
    create = getattr(node, f"create_{reading}_observable")
    create(Float64, "topic", ticks, timestamped=True, item=lambda it: half(it.value)).subscribe(
        received.append
    )
    publisher = peer.create_publisher(Float64, "topic", 10)
    spin_until(lambda: publisher.get_subscription_count() == 1)
    for data in (-1.0, 4.0):
        publisher.publish(Float64(data=data))
        spin_for(0.05)
        ticks.on_next(None)
    assert received == [2.0]


def test_error_while_an_item_is_made_is_an_error_for_all_observers(readers: Readers) -> None:
    errors: list[tuple[str, type[Exception]]] = []
    observable = readers.observable(10, item=lambda message: message / 0)
    for name in ("one", "two"):
        observable.subscribe(on_error=lambda error, name=name: errors.append((name, type(error))))
    readers.receive(0, "a", 1)
    assert errors == [("one", TypeError), ("two", TypeError)]
    (reader,) = readers.created
    assert readers.destroyed == [reader]


def test_error_of_an_observer_is_no_error_of_the_observable(readers: Readers) -> None:
    def fail(_: Any) -> None:
        raise ValueError("planted")

    errors: list[Exception] = []
    readers.observable(10, item=str.upper).subscribe(fail, errors.append)
    with pytest.raises(ValueError, match="planted"):
        readers.receive(0, "a", 1)
    assert not errors


@pytest.mark.parametrize("qos", [10, LATCHED])
@pytest.mark.parametrize("item", [None, str.upper])
@pytest.mark.parametrize("timestamped", [False, True])
def test_info_is_collected_only_for_timestamps(
    readers: Readers, qos: Any, item: Any, timestamped: bool
) -> None:
    readers.observable(qos, item=item, timestamped=timestamped, every_publisher=True).subscribe()
    assert [reader.collects_info for reader in readers.created] == [timestamped]


def test_info_is_collected_while_there_are_two_readers(readers: Readers) -> None:
    observable = readers.observable(LATCHED, every_publisher=True)
    subscription = observable.subscribe()
    readers.find_volatile_publisher()
    assert [reader.collects_info for reader in readers.created] == [True, True]
    subscription.dispose()
    observable.subscribe()
    assert not readers.created[2].collects_info


# Every publisher


@pytest.mark.parametrize("timestamped", [False, True])
@pytest.mark.parametrize("first", [0, 1])
def test_what_two_readers_deliver_comes_once(readers: Readers, timestamped: bool, first: int) -> None:
    received: list[Any] = []
    readers.observable(LATCHED, every_publisher=True, timestamped=timestamped).subscribe(
        lambda item: received.append(int(item.value if timestamped else item))
    )
    readers.find_volatile_publisher()
    for reader in (first, 1 - first):
        for time in range(1000):  # a burst
            readers.receive(reader, str(time), time)
    assert received == [*range(1000)]


def test_messages_of_one_source_time_are_different_ones(readers: Readers) -> None:
    received: list[str] = []
    readers.observable(LATCHED, every_publisher=True).subscribe(received.append)
    readers.find_volatile_publisher()
    for reader, message in ((1, "latched"), (1, "by hand"), (0, "latched"), (1, "again")):
        readers.receive(reader, message, 7)
    assert received == ["latched", "by hand", "again"]


@pytest.mark.parametrize("first", [0, 1])
def test_pair_is_two_messages_of_one_source_time(readers: Readers, first: int) -> None:
    received: list[str] = []
    readers.observable(LATCHED, every_publisher=True).subscribe(received.append)
    readers.find_volatile_publisher()
    second = 1 - first
    for reader, message, time in ((first, "a", 1), (second, "b", 2), (second, "a", 1), (second, "c", 1)):
        readers.receive(reader, message, time)
    assert received == ["a", "b", "c"]


def test_messages_without_a_pair_are_forgotten(readers: Readers, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("time.monotonic_ns", lambda: now)
    pairs = message_reader.Pairs()
    for second in range(1000):
        now = second * 10**9
        assert not pairs.completes(now, -1)
    assert len(pairs) == 11


def test_one_reader_delivers_no_copies(readers: Readers) -> None:
    received: list[Any] = []
    readers.observable(LATCHED, every_publisher=True).subscribe(received.append)
    readers.receive(0, "a", 1)
    readers.receive(0, "a", 1)
    assert received == ["a", "a"]


def test_second_reader_is_volatile_and_the_only_one(readers: Readers) -> None:
    readers.observable(LATCHED, every_publisher=True).subscribe()
    assert readers.qos == [LATCHED]
    for _ in range(2):
        readers.find_volatile_publisher()
    assert [(qos.depth, qos.durability) for qos in readers.qos[1:]] == [(3, VOLATILE)]
    assert LATCHED.durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_last_observer_ends_both_readers(readers: Readers) -> None:
    subscription = readers.observable(LATCHED, every_publisher=True).subscribe()
    readers.find_volatile_publisher()
    subscription.dispose()
    first, second = readers.created
    assert readers.destroyed == [first, second]
    readers.find_volatile_publisher()  # an event that comes too late
    assert len(readers.created) == 2


def test_next_observer_begins_with_one_reader(readers: Readers) -> None:
    received: list[Any] = []
    observable = readers.observable(LATCHED, every_publisher=True)
    subscription = observable.subscribe()
    readers.find_volatile_publisher()
    readers.receive(0, "a", 1)
    subscription.dispose()
    observable.subscribe(received.append)
    readers.receive(2, "a", 1)
    assert received == ["a"]


@pytest.mark.parametrize(
    ("qos", "every_publisher"), [(10, True), (QoSProfile(depth=1), True), (LATCHED, False)]
)
def test_second_reader_is_only_of_latched_topics_if_wanted(
    readers: Readers, qos: Any, every_publisher: bool
) -> None:
    readers.observable(qos, every_publisher=every_publisher).subscribe()
    assert readers.events == [None]
