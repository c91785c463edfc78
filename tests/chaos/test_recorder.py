"""The recorder reports in which time the middleware has lost messages."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from deploy.recording import recorder
from interfaces import topics


class Subscriptions:
    """In place of a node: keeps what the recorder subscribes to, by topic name."""

    def __init__(self) -> None:
        self.write: dict[str, Any] = {}
        self.lose: dict[str, Any] = {}

    def resolve_topic_name(self, name: str) -> str:
        return name

    def create_subscription(
        self, kind: type, name: str, write: Any, qos: Any, *, raw: bool, event_callbacks: Any
    ) -> None:
        self.write[name] = write
        self.lose[name] = event_callbacks.message_lost


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
    recorder.record(subscriptions, file, lost=lambda begin, end: reports.append((begin, end)))
    yield subscriptions
    file.close()


def receive(
    node: Subscriptions,
    clock: Clock,
    at: float,
    topic: topics.Topic = topics.L2,
    number: int | None = None,
) -> None:
    clock.now = at
    info = {"source_timestamp": time.time_ns(), "publication_sequence_number": number}
    node.write[topic.name](b"", info)


def lose(node: Subscriptions, clock: Clock, at: float, topic: topics.Topic = topics.L2) -> None:
    clock.now = at
    node.lose[topic.name](SimpleNamespace(total_count=1, total_count_change=1))


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


def test_a_missing_number_is_a_loss(
    node: Subscriptions, clock: Clock, reports: list[tuple[float, float]]
) -> None:
    for at, number in ((1.0, 7), (2.0, 8), (3.0, 10), (4.0, 11)):
        receive(node, clock, at, number=number)
    assert reports == [(2.0, 3.0)]


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


def test_numbers_of_a_new_publisher_begin_anew(
    node: Subscriptions, clock: Clock, reports: list[tuple[float, float]]
) -> None:
    for at, number in ((1.0, 7), (2.0, 1), (3.0, 2)):
        receive(node, clock, at, number=number)
    assert not reports


@pytest.mark.parametrize("topic", [topics.ENGINES, topics.DIAGNOSTICS], ids=lambda topic: topic.name)
def test_numbers_of_several_publishers_mean_nothing(
    node: Subscriptions, clock: Clock, reports: list[tuple[float, float]], topic: topics.Topic
) -> None:
    for at, number in ((1.0, 7), (2.0, 90), (3.0, 8), (4.0, 91)):
        receive(node, clock, at, topic, number)
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
