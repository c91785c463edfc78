from __future__ import annotations

import json
import re
from pathlib import Path

from deploy.runtime.tests.nodes import MakeNode
from hypothesis import given
from hypothesis import strategies as st

from rclpy._dds.discovery import Discovery
from rclpy._discovery_info import NodeEntities, decode, encode
from rclpy.node import Node

FACTS = Path(__file__).parents[1] / "facts"


def recorded(kind: str) -> dict[str, tuple[str, str]]:
    """Topic → (type, user data without the service identifier) of the recorded endpoints."""
    endpoints = {}
    for line in (FACTS / "discovery.txt").read_text().splitlines():
        if line.startswith(kind):
            _, _, topic, type_name = line.split(" ")[:4]
            data = re.search(r"Policy\.Userdata\(data=b'(.*?)'\)", line)
            assert data
            endpoints[topic] = (type_name, re.sub(r"serviceid=[^;]*;", "serviceid;", data[1]))
    return endpoints


def announced(endpoints: list[object]) -> dict[str, tuple[str, str]]:
    return {
        endpoint.topic: (endpoint.type_name, re.sub(r"serviceid=[^;]*;", "serviceid;", endpoint.user_data))
        for endpoint in endpoints
    }


def test_writers_and_readers_are_announced_as_recorded(facts_node: Node) -> None:
    discovery = Discovery(facts_node._rclpy_graph.participant.handle)
    assert announced(discovery.writers()) == recorded("PUB")
    assert announced(discovery.readers()) == recorded("SUB")


def test_a_participant_announces_its_enclave(make_node: MakeNode) -> None:
    node = make_node()
    graph = node._rclpy_graph
    assert Discovery(graph.participant.handle).participants()[graph.participant.gid] == "enclave=/;"


def test_service_identifiers_have_the_recorded_form(facts_node: Node) -> None:
    graph = facts_node._rclpy_graph
    data = [endpoint.user_data for endpoint in Discovery(graph.participant.handle).writers()]
    identifiers = [
        match[1] for text in data if (match := re.match(r"serviceid=( [0-9a-f.]+);typehash", text))
    ]
    assert len(identifiers) == len(set(identifiers)) == 8
    prefix = ".".join(f"{octet:x}" for octet in graph.participant.gid[:12])
    assert set(identifiers) == {f" {prefix}.0.0.0.{number:x}" for number in range(1, 9)}


def test_the_recorded_discovery_info_survives_a_round_trip() -> None:
    data = bytes.fromhex(
        json.loads((FACTS / "wire_samples.json").read_text())["samples"]["ros_discovery_info"]
    )
    gid, nodes = decode(data)
    assert [(node.namespace, node.name) for node in nodes] == [("/arm1", "facts")]
    assert (len(nodes[0].readers), len(nodes[0].writers)) == (9, 13)
    assert encode(gid, nodes) == data


@given(
    st.lists(
        st.tuples(
            st.text(alphabet=st.characters(codec="utf-8", exclude_characters="\0"), max_size=8),
            st.text(alphabet=st.characters(codec="utf-8", exclude_characters="\0"), max_size=8),
            st.lists(st.binary(min_size=16, max_size=16), max_size=3),
            st.lists(st.binary(min_size=16, max_size=16), max_size=3),
        ),
        max_size=4,
    )
)
def test_discovery_info_survives_a_round_trip(
    nodes: list[tuple[str, str, list[bytes], list[bytes]]],
) -> None:
    entities = []
    for namespace, name, readers, writers in nodes:
        node = NodeEntities(namespace, name)
        node.readers, node.writers = readers, writers
        entities.append(node)
    gid, result = decode(encode(bytes(range(16)), entities))
    assert gid == bytes(range(16))
    assert [(node.namespace, node.name, node.readers, node.writers) for node in result] == nodes
