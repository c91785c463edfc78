"""The part of the graph that answers questions about nodes, topics and services."""

from __future__ import annotations

from collections.abc import Iterator

from rclpy import _names
from rclpy._dds.discovery import Discovery, Endpoint
from rclpy._dds.qos import user_data_value
from rclpy._discovery_info import NodeEntities
from rclpy.exceptions import NodeNameNonExistentError

NamesAndTypes = list[tuple[str, list[str]]]


class GraphQueries:
    """What a process knows of the nodes in its domain."""

    def __init__(self) -> None:
        self._topics: dict[bool, tuple[list[Endpoint], NamesAndTypes]] = {}

    def _discovered(self) -> Discovery:
        raise NotImplementedError

    def _nodes(self) -> Iterator[tuple[bytes, NodeEntities]]:
        raise NotImplementedError

    def node_names(self) -> list[tuple[str, str, str]]:
        enclaves = self._discovered().participants()
        return [
            (node.name, node.namespace, user_data_value(enclaves.get(gid, ""), "enclave") or "/")
            for gid, node in self._nodes()
        ]

    def _with_owners(self, endpoints: list[Endpoint]) -> list[tuple[Endpoint, str, str]]:
        """Each endpoint with name and namespace of its node, or ROS 2's names for an unknown node."""
        nodes: dict[bytes, list[NodeEntities]] = {}
        for gid, node in self._nodes():
            nodes.setdefault(gid, []).append(node)
        return [(endpoint, *_owner(endpoint, nodes.get(endpoint.participant, []))) for endpoint in endpoints]

    def _writers_and_readers(self) -> list[Endpoint]:
        return self._discovered().writers() + self._discovered().readers()

    def topic_names_and_types(self, no_demangle: bool) -> NamesAndTypes:
        """Return every topic that has a reader or writer, with its types."""
        endpoints = self._writers_and_readers()
        known, names = self._topics.get(no_demangle, ([], []))
        if endpoints != known:  # collecting them is slow in a large domain, and some programs ask often
            names = _collect_topics(endpoints, no_demangle)
            self._topics[no_demangle] = (endpoints, names)
        return [(name, list(types)) for name, types in names]

    def service_names_and_types(self) -> NamesAndTypes:
        """Return every service that has a server or client, with its types."""
        return _collect_services(self._writers_and_readers())

    def _of_node(self, name: str, namespace: str, kind: str, endpoints: list[Endpoint]) -> list[Endpoint]:
        gids: set[bytes] = set()
        found = False
        for _, node in self._nodes():
            if (node.name, node.namespace) == (name, namespace):
                found = True
                gids.update(getattr(node, kind))
        if not found:
            raise NodeNameNonExistentError(f"Cannot find the node {namespace.rstrip('/')}/{name}")
        return [endpoint for endpoint in endpoints if endpoint.gid in gids]

    def publishers_of_node(self, name: str, namespace: str, no_demangle: bool) -> NamesAndTypes:
        writers = self._of_node(name, namespace, "writers", self._discovered().writers())
        return _collect_topics(writers, no_demangle)

    def subscriptions_of_node(self, name: str, namespace: str, no_demangle: bool) -> NamesAndTypes:
        readers = self._of_node(name, namespace, "readers", self._discovered().readers())
        return _collect_topics(readers, no_demangle)

    def services_of_node(self, name: str, namespace: str) -> NamesAndTypes:
        """Return the services that a node serves: it reads their requests."""
        readers = self._of_node(name, namespace, "readers", self._discovered().readers())
        return _collect_services([reader for reader in readers if reader.topic.startswith("rq/")])

    def clients_of_node(self, name: str, namespace: str) -> NamesAndTypes:
        """Return the services that a node calls: it reads their replies."""
        readers = self._of_node(name, namespace, "readers", self._discovered().readers())
        return _collect_services([reader for reader in readers if reader.topic.startswith("rr/")])

    def writers_of(self, dds_topic: str) -> list[tuple[Endpoint, str, str]]:
        """Return the writers on a topic, each with its node's name and namespace."""
        return self._with_owners([w for w in self._discovered().writers() if w.topic == dds_topic])

    def readers_of(self, dds_topic: str) -> list[tuple[Endpoint, str, str]]:
        """Return the readers on a topic, each with its node's name and namespace."""
        return self._with_owners([r for r in self._discovered().readers() if r.topic == dds_topic])

    def count_writers(self, dds_topic: str) -> int:
        return sum(writer.topic == dds_topic for writer in self._discovered().writers())

    def count_readers(self, dds_topic: str) -> int:
        return sum(reader.topic == dds_topic for reader in self._discovered().readers())


def _owner(endpoint: Endpoint, nodes: list[NodeEntities]) -> tuple[str, str]:
    """Name and namespace of the endpoint's node, which is one of its participant's nodes."""
    for node in nodes:
        if endpoint.gid in node.readers or endpoint.gid in node.writers:
            return node.name, node.namespace
    return "_NODE_NAME_UNKNOWN_", "_NODE_NAMESPACE_UNKNOWN_"


def _sorted(found: dict[str, set[str]]) -> NamesAndTypes:
    return [(name, sorted(types)) for name, types in sorted(found.items())]


def _collect_topics(endpoints: list[Endpoint], no_demangle: bool) -> NamesAndTypes:
    found: dict[str, set[str]] = {}
    for topic, type_name in {(endpoint.topic, endpoint.type_name) for endpoint in endpoints}:
        if no_demangle:
            found.setdefault(topic, set()).add(type_name)
        elif (name := _names.topic_from_dds(topic)) is not None:
            found.setdefault(name, set()).add(_names.type_from_dds(type_name))
    return _sorted(found)


def _collect_services(endpoints: list[Endpoint]) -> NamesAndTypes:
    found: dict[str, set[str]] = {}
    for endpoint in endpoints:
        if (name := _names.service_from_dds(endpoint.topic)) is not None:
            found.setdefault(name, set()).add(_names.service_type_from_dds(endpoint.type_name))
    return _sorted(found)
