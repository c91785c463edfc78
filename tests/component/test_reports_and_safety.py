"""Reports of health, which a stranger can forge, and the three fail-safes (deploy/SAFETY.md, A2)."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta

import pytest

from interfaces.arm_variables import HOST
from interfaces.latch import Command, Comparison, Latch, Tick
from interfaces.service import ServiceNode
from interfaces.topics import DIAGNOSTICS, OFF, ON, TURN_OFF, TURN_ON
from reactive_node.testing import MakeNode
from services import drive, engine_controller, operator_watchdog
from services.engine_controller import step


@pytest.mark.parametrize(
    "wire", [operator_watchdog.wire, engine_controller.wire, drive.wire], ids=["F1", "F2", "F3"]
)
def test_no_fail_safe_reads_reports_of_health(
    make_node: MakeNode, wire: Callable[[ServiceNode], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(HOST, raising=False)
    node = make_node("service", kind=ServiceNode)
    wire(node)
    assert DIAGNOSTICS.name not in {each.topic_name for each in node.subscriptions}


@pytest.mark.parametrize("refusal", ["", "the clock of host desk is more than 50 ms behind ours"])
def test_comparison_of_clocks_keeps_no_engines_on(refusal: str) -> None:
    """With two hosts, reports of health show their clocks: the controller may only refuse `turn_on`."""
    begin = datetime(2026, 1, 1, tzinfo=UTC)
    running = Latch(ON, seen=begin, repeated=begin, refusal=refusal)

    assert step(running, Command(begin, 0.0, TURN_OFF)).engines == OFF
    late = running._replace(seen=begin - timedelta(seconds=10.0))
    for event in (Tick(begin), Command(begin, 0.0, TURN_ON), Comparison(begin, refusal)):
        assert step(late, event).engines == OFF


def test_comparison_of_clocks_turns_no_engines_on() -> None:
    begin = datetime(2026, 1, 1, tzinfo=UTC)
    latch = step(Latch(repeated=begin), Comparison(begin, ""))
    assert latch.engines == OFF
    assert step(latch, Command(begin, 0.0, TURN_ON)).engines == OFF
