from __future__ import annotations

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from deploy.supervision.flood import Flood
from reactive_node.strangers import Endpoint

LOST = "so many messages arrive that reports of health are lost"


class Node:
    """A node that knows publishers of health."""

    def __init__(self, *names: str) -> None:
        self.names = names

    def publishers_of(self, topic: str) -> list[Endpoint]:
        assert topic == "/diagnostics"
        parts = [full.rpartition("/") for full in self.names]
        return [Endpoint(name, space or "/", "", ()) for space, _, name in parts]


def about(*names: str) -> DiagnosticArray:
    return DiagnosticArray(status=[DiagnosticStatus(name=name) for name in names])


def flood(*publishers: str) -> Flood:
    return Flood(Node(*publishers), {"/arm/velocity"})  # type: ignore[arg-type]


def test_without_a_full_reader_nothing_is_lost() -> None:
    it = flood("/motor")
    for _ in range(999):
        it.hear(about("motor"))
    assert it.look() == ""


def test_flood_is_named_by_what_most_messages_are_about_and_by_strangers() -> None:
    it = flood("/arm/velocity", "/motor", "/lidar/driver", "/motor")
    for name in ("motor: left", "velocity", "motor: left"):
        it.hear(about(name, "more"))
    it.hear(about())
    it.overflow()
    strangers = "these nodes are not of the arm: '/lidar/driver', '/motor'"
    assert it.look() == f"{LOST}, most of them about 'motor: left'; {strangers}"


def test_flood_that_the_arm_makes_itself_names_no_stranger() -> None:
    it = flood("/arm/velocity")
    it.overflow()
    assert it.look() == LOST


def test_names_of_strangers_are_shown_without_control_characters_and_few() -> None:
    it = flood("/a\x1b[2J", "/b", "/c", "/d")
    it.hear(about("\x1b]0;title\x07"))
    it.overflow()
    assert it.look().isprintable()
    assert "/d" not in it.look()


def test_lost_reports_are_remarked_for_five_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    it = flood("/motor")
    it.overflow()
    words = it.look()
    now = 104.9
    assert it.look() == words
    now = 105.0
    assert it.look() == ""
