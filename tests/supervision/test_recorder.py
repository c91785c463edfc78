"""The recorder reports in which time the middleware has lost messages. It records no flood in full."""

from __future__ import annotations

import itertools
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from reactivex.testing import TestScheduler

from deploy.supervision import recorder
from interfaces import topics
from interfaces.limits import LARGEST_MESSAGE

FOREIGN = b"from another publisher"


class Reader:
    """In place of a subscription, and of its handle: keeps the newest messages, as many as its QoS says."""

    msg_type: Any = None
    raw = True

    def __init__(self, depth: int) -> None:
        self.kept: deque[tuple[bytes, dict[str, int]]] = deque(maxlen=depth)
        self.handle = self

    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        pass

    def take_message(self, *_: object) -> tuple[bytes, dict[str, int]] | None:
        return self.kept.popleft() if self.kept else None


class Subscriptions:
    """In place of a node: keeps what the recorder subscribes to, by topic name."""

    def __init__(self) -> None:
        self.write: dict[str, Any] = {}
        self.lose: dict[str, Any] = {}
        self.readers: dict[str, Reader] = {}
        self.scheduler = TestScheduler()
        self.warnings: list[str] = []

    def resolve_topic_name(self, name: str) -> str:
        return name

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=lambda text, once: self.warnings.append(text))

    def create_subscription(
        self, kind: type, name: str, write: Any, qos: Any, *, event_callbacks: Any, **_: Any
    ) -> Reader:
        self.write[name] = write
        self.lose[name] = event_callbacks.message_lost
        self.readers[name] = Reader(qos.depth)
        return self.readers[name]


class Clock:
    """In place of `time`: a monotonic clock that the test sets [s]."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 0.0
        monkeypatch.setattr(time, "monotonic_ns", lambda: round(self.now * 1e9))


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


@pytest.fixture
def reports() -> list[tuple[float, float]]:
    return []


@pytest.fixture
def node(tmp_path: Path, reports: list[tuple[float, float]]) -> Iterator[Subscriptions]:
    subscriptions: Any = Subscriptions()
    file = recorder.Recorder(tmp_path / "record.mcap", 0, 10**18)
    recorder.record(
        subscriptions,
        file,
        lost=lambda begin, end: reports.append((begin, end)),
        is_foreign=lambda topic, data: data == FOREIGN,
    )
    yield subscriptions
    file.close()


def receive(
    node: Subscriptions,
    clock: Clock,
    at: float,
    topic: topics.Topic = topics.L2,
    number: int | None = None,
    data: bytes = b"",
) -> None:
    clock.now = at
    info = {"source_timestamp": time.time_ns(), "publication_sequence_number": number}
    node.write[topic.name](data, info)


def lose(node: Subscriptions, clock: Clock, at: float, topic: topics.Topic = topics.L2) -> None:
    clock.now = at
    if callback := node.lose[topic.name]:  # without one, rclpy reports nothing
        callback(SimpleNamespace(total_count=1, total_count_change=1))


def covered(reports: list[tuple[float, float]], moment: float) -> bool:
    return any(begin <= moment <= end for begin, end in reports)


@pytest.mark.parametrize("first", ["the loss", "the next message"])
def test_a_loss_is_reported_from_the_last_message_before_it(
    node: Subscriptions, clock: Clock, reports: list[tuple[float, float]], first: str
) -> None:
    receive(node, clock, 1.0)
    receive(node, clock, 2.0)
    if first == "the loss":
        lose(node, clock, 4.0)
        receive(node, clock, 4.0)
    else:
        receive(node, clock, 4.0)
        lose(node, clock, 4.001)
    assert covered(reports, 2.0)
    assert covered(reports, 4.0)
    assert not covered(reports, 0.9)
    assert not covered(reports, 4.1)


@pytest.mark.parametrize(
    ("topic", "numbers", "lost"),
    [
        (topics.L2, [7, 8, 10, 11], [(2.0, 3.0)]),
        (topics.L2, [7, 1, 2], []),  # a new publisher begins again
        (topics.ENGINES, [7, 90, 8, 91], []),  # those of several publishers mean nothing
        (topics.DIAGNOSTICS, [7, 90, 8, 91], []),
    ],
)
def test_a_missing_number_of_a_publisher_is_a_loss(
    node: Subscriptions,
    clock: Clock,
    reports: list[tuple[float, float]],
    topic: topics.Topic,
    numbers: list[int],
    lost: list[tuple[float, float]],
) -> None:
    for at, number in enumerate(numbers, 1):
        receive(node, clock, at, topic, number)
    assert reports == lost


def test_pause_between_two_clocks_changes_no_time(
    node: Subscriptions, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    epoch, pauses = 10**18, iter([0.01, 0.02])  # s
    recorded: list[tuple[int, int]] = []

    def time_of_day() -> int:
        clock.now += next(pauses, 0.0)
        return epoch + time.monotonic_ns()

    monkeypatch.setattr(time, "time_ns", time_of_day)
    monkeypatch.setattr(recorder.Recorder, "message", lambda *message: recorded.append(message[-2:]))
    clock.now = 2.0
    info = {"source_timestamp": epoch + 1_500_000_000, "publication_sequence_number": None}
    node.write[topics.L2.name](b"", info)
    assert recorded == [(2_030_000_000, 1_500_000_000)]


def test_numbers_of_a_foreign_publisher_mean_nothing(
    node: Subscriptions, clock: Clock, reports: list[tuple[float, float]]
) -> None:
    for at, number in enumerate((7, 90, 8, 1, 9), 1):
        receive(node, clock, at, number=number, data=FOREIGN if number in (90, 1) else b"")
    assert not reports


def test_a_loss_before_the_first_message_is_a_moment(
    node: Subscriptions, clock: Clock, reports: list[tuple[float, float]]
) -> None:
    lose(node, clock, 4.0)
    assert reports == [(4.0, 4.0)]


def test_lost_heartbeats_are_not_reported(
    node: Subscriptions, clock: Clock, reports: list[tuple[float, float]]
) -> None:
    lose(node, clock, 4.0, topics.OPERATOR_HEARTBEAT)
    assert not reports


@pytest.fixture
def recorded(monkeypatch: pytest.MonkeyPatch) -> list[tuple[bytes, int]]:
    """Return the messages that the recorder writes, and their source times on the monotonic clock."""
    messages: list[tuple[bytes, int]] = []
    monkeypatch.setattr(
        recorder.Recorder,
        "message",
        lambda self, topic, type_name, qos, data, received, sent: messages.append((data, sent)),
    )
    monkeypatch.setattr(time, "time_ns", lambda: time.monotonic_ns() + 10**18)
    return messages


def test_message_that_no_service_reads_is_not_recorded(
    node: Subscriptions, clock: Clock, recorded: list[tuple[bytes, int]]
) -> None:
    info = {"source_timestamp": 10**18, "publication_sequence_number": 1}
    for size in (LARGEST_MESSAGE + 1, LARGEST_MESSAGE):
        node.write[topics.DIAGNOSTICS.name](bytes(size), info)
    assert [len(data) for data, _ in recorded] == [LARGEST_MESSAGE]
    assert "/diagnostics: messages of more than 32768 octets are not recorded" in node.warnings[0]


def send_heartbeat(node: Subscriptions, clock: Clock, at: float) -> None:
    """Let a heartbeat arrive a millisecond after it was sent [s]."""
    clock.now = at + 0.001
    node.scheduler.advance_to(clock.now)
    info = {"source_timestamp": round(at * 1e9) + 10**18}
    node.readers[topics.OPERATOR_HEARTBEAT.name].kept.append((b"", info))


def test_each_heartbeat_of_a_switch_is_recorded(
    node: Subscriptions, clock: Clock, recorded: list[tuple[bytes, int]]
) -> None:
    sent = [0.05 * number + 0.010_000_001 for number in range(40)]
    for at in sent:
        send_heartbeat(node, clock, at)
    clock.now = 2.1
    node.scheduler.advance_to(clock.now)
    assert recorded == [(b"", round(at * 1e9)) for at in sent]


def test_of_a_flood_of_heartbeats_the_newest_are_recorded(
    node: Subscriptions, clock: Clock, recorded: list[tuple[bytes, int]]
) -> None:
    for number in range(10_000):
        send_heartbeat(node, clock, 1.0 + number / 10_000)
    clock.now = 2.1
    node.scheduler.advance_to(clock.now)
    assert len(recorded) <= 210
    assert recorded[-1] == (b"", 1_999_900_000)
    assert max(later - sent for (_, sent), (_, later) in itertools.pairwise(recorded)) < 51_000_000


def test_recorded_source_times_are_exact(tmp_path: Path) -> None:
    """Clocks that are read one after the other change no time; a clock that is set by hand does."""
    file = recorder.Recorder(tmp_path / "record.mcap", 5_000, 1_700_000_000_000_000_000)
    source = 1_700_000_001_000_000_123

    assert file.monotonic(source, (9_000, 1_700_000_000_000_004_321)) == 1_000_005_123
    assert file.monotonic(source, (9_000, 1_700_000_003_000_004_321)) == 1_000_005_123 - 3 * 10**9
    file.close()
