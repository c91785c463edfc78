from __future__ import annotations

import json
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from std_msgs.msg import Float64

from interfaces.service import ServiceNode
from interfaces.service.health import reported_refusals
from interfaces.service.states import LATENESS, observe_state
from interfaces.topics import L1, THETA1
from reactive_node.signals import CERTAIN, HELD, Answer
from reactive_node.testing import MakeNode, SpinUntil

NS = 10**9


class Observed:
    def __init__(self, make_node: MakeNode, spin_until: SpinUntil) -> None:
        self.service: ServiceNode = make_node("service", kind=ServiceNode)
        self.peer = make_node("peer")
        self.found: list[Answer[float]] = []
        self.publisher = self.peer.create_publisher(L1.type, L1.name, L1.qos)
        asked = observe_state(self.service, L1).sample(0.02)
        asked.subscribe(self.found.append, scheduler=self.service.scheduler)
        spin_until(self.publisher.get_subscription_count)
        self.publisher.publish(Float64(data=2.0))
        spin_until(lambda: self.found and self.found[-1].mark == CERTAIN)


def test_silence_means_unchanged_while_the_publisher_lives(
    make_node: MakeNode, spin_until: SpinUntil
) -> None:
    observed = Observed(make_node, spin_until)
    since = observed.found[-1].time

    spin_until(lambda: observed.found[-1].time > since + NS)

    assert {(it.value, it.mark) for it in observed.found if it.time > since} == {(2.0, CERTAIN)}


def test_value_is_held_while_the_publisher_is_dead(make_node: MakeNode, spin_until: SpinUntil) -> None:
    observed = Observed(make_node, spin_until)

    observed.peer.destroy_publisher(observed.publisher)
    spin_until(lambda: observed.found[-1].mark == HELD)
    assert observed.found[-1].value == 2.0

    observed.peer.create_publisher(L1.type, L1.name, L1.qos).publish(Float64(data=2.0))
    spin_until(lambda: observed.found[-1].mark == CERTAIN)


def test_late_samples_are_counted_and_reported_for_a_replay(
    make_node: MakeNode, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first value is old for a late reader, which is usual."""
    reports: list[dict[str, str]] = []
    observed = Observed(make_node, spin_until)
    health = observed.service.health
    publish = health.publisher.publish

    def keep(message: Any) -> None:
        (status,) = message.status
        reports.append({"message": status.message, **{pair.key: pair.value for pair in status.values}})
        publish(message)

    monkeypatch.setattr(health.publisher, "publish", keep, raising=False)
    clock = observed.service.get_clock()
    ahead = round(2 * LATENESS * NS)
    late = clock.now().nanoseconds
    monkeypatch.setattr(observed.service.scheduler, "time_of_stamps", lambda: clock.now().nanoseconds + ahead)
    observed.publisher.publish(Float64(data=3.0))
    spin_until(lambda: observed.found[-1].value == 3.0)
    health.report()

    (report,) = [each for each in reports if "refused l1" in each]
    ((time, taken),) = json.loads(report["refused l1"])
    assert late <= time <= clock.now().nanoseconds
    assert time < taken <= clock.now().nanoseconds + ahead
    assert report["message"].startswith("l1: it is 0.1")
    health.report()
    assert "refused l1" not in reports[-1]


def test_dropped_sample_counts_as_dropped() -> None:
    status = DiagnosticStatus(
        values=[KeyValue(key="refused l1", value="[[5, null], [7, 9]]"), KeyValue(key="pid", value="1")]
    )

    assert reported_refusals(status, L1.name) == [(5, None), (7, 9)]
    assert reported_refusals(status, THETA1.name) == []
