"""The QoS that nodes announce, read by Cyclone DDS's own Python package, against a real ROS 2 Jazzy."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from deploy.ground.tests.nodes import SpinUntil
from rclpy.node import Node

REASON = "platform: PyPI has no Python package of Cyclone DDS for this Python"
builtin = pytest.importorskip("cyclonedds.builtin", reason=REASON, exc_type=ImportError)
domain = pytest.importorskip("cyclonedds.domain", reason=REASON, exc_type=ImportError)

RECORD = (Path(__file__).parents[1] / "facts" / "discovery.txt").read_text()
KINDS = {"PUB": builtin.BuiltinTopicDcpsPublication, "SUB": builtin.BuiltinTopicDcpsSubscription}


def policies(qos: str) -> list[str]:
    """Split the text of a QoS into its policies, without USER_DATA, which other tests compare."""
    inner = qos.removeprefix("Qos(").removesuffix(")")
    return [each for each in re.split(r", (?=Policy\.)", inner) if "Userdata" not in each]


def recorded(kind: str) -> dict[str, list[str]]:
    rows = (line.split(" ", 4) for line in RECORD.splitlines() if line.startswith(f"{kind} "))
    return {topic: policies(qos) for _, _, topic, _, qos in rows}


@pytest.fixture
def reader(domain_id: int) -> Iterator[Callable[[str], dict[str, list[str]]]]:
    """Reads the policies of the endpoints in the test's domain by their topics."""
    participant = domain.DomainParticipant(domain_id)
    readers = {kind: builtin.BuiltinDataReader(participant, topic) for kind, topic in KINDS.items()}
    yield lambda kind: {
        each.topic_name: policies(str(each.qos)) for each in readers[kind].read(1000) if each.topic_name
    }
    readers.clear()
    del participant


@pytest.mark.parametrize("kind", KINDS)
def test_qos_of_all_endpoints_is_announced_as_recorded(
    kind: str, facts_node: Node, reader: Callable[[str], dict[str, list[str]]], spin_until: SpinUntil
) -> None:
    expected = recorded(kind)
    spin_until(lambda: expected.keys() <= reader(kind).keys())

    announced = reader(kind)

    assert {topic: announced[topic] for topic in expected} == expected
