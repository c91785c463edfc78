from __future__ import annotations

import os
import socket

import pytest
import reactivex as rx
from reactivex.testing import ReactiveTest, Recorded

from reactive_node import domains
from reactive_node.domains import reserved_domain
from reactive_node.testing import VirtualTime

on_next, on_error, on_completed = ReactiveTest.on_next, ReactiveTest.on_error, ReactiveTest.on_completed
subscribe = ReactiveTest.subscribe


def test_environment_selects_domain_on_this_machine(
    monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE")
    for profiles in ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"):
        monkeypatch.delenv(profiles, raising=False)  # conftest.py replaces the range by a profile

    domain_id = request.getfixturevalue("domain_id")

    assert os.environ["ROS_DOMAIN_ID"] == str(domain_id)
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"


def test_recipe_is_recorded_in_seconds_from_zero(scheduler: VirtualTime) -> None:
    numbers = scheduler.hot((0, 1), (0.25, 2), (2.01, 3), (3, 4), (3.5, 5))

    recording = scheduler.record(numbers.map(lambda number: 10 * number), until=3)

    assert recording.items == [(0, 10), (0.25, 20), (2.01, 30), (3, 40)]
    assert numbers.subscriptions == [subscribe(0, 3)]


def test_recording_starts_at_present_time(scheduler: VirtualTime) -> None:
    numbers = scheduler.hot((1, 1), (2, 2))
    scheduler.advance_to(1.5)

    assert scheduler.record(numbers, until=9).items == [(2, 2)]
    assert numbers.subscriptions == [subscribe(1.5, 9)]


def test_operators_run_in_virtual_time(scheduler: VirtualTime) -> None:
    assert scheduler.record(rx.interval(0.5), until=1.75).items == [(0.5, 0), (1.0, 1), (1.5, 2)]


@pytest.mark.parametrize(
    "end", [on_error(2, ValueError("planted")), on_completed(2)], ids=["error", "completion"]
)
def test_messages_include_error_and_completion(scheduler: VirtualTime, end: Recorded[str]) -> None:
    source = scheduler.create_hot_observable(on_next(1, "item"), end)

    recording = scheduler.record(source, until=9)

    assert recording.messages == [on_next(1, "item"), end]
    assert recording.items == [(1, "item")]
    assert source.subscriptions == [subscribe(0, 2)]


def test_more_than_a_hundred_items_at_one_time_keep_their_time(scheduler: VirtualTime) -> None:
    many = scheduler.hot(*((1, number) for number in range(500)))

    assert scheduler.record(many, until=2).items == [(1, number) for number in range(500)]


# Domains


def test_domain_is_reserved_once_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    with reserved_domain() as first:
        monkeypatch.setattr(domains, "DOMAINS", range(first, first + 1))
        with pytest.raises(RuntimeError, match="no free ROS domain"), reserved_domain():
            pass


@pytest.mark.parametrize("offset", [0, 10, 35, 249])
def test_domain_with_participants_is_not_free(offset: int) -> None:
    with reserved_domain() as free, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        assert not domains.has_participants(free)
        participant.bind(("127.0.0.1", 7400 + 250 * free + offset))
        assert domains.has_participants(free)


def test_error_inside_reservation_is_raised() -> None:
    with pytest.raises(OSError, match="planted"), reserved_domain():
        raise OSError("planted")
