"""The part of `Node` that queries the graph."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING

from rclpy import _names
from rclpy._dds.discovery import Endpoint
from rclpy._dds.qos import user_data_value
from rclpy._node_names import NodeNames
from rclpy.topic_endpoint_info import TopicEndpointInfo, TopicEndpointTypeEnum
from rclpy.type_hash import TypeHash

if TYPE_CHECKING:
    from rclpy._graph import Graph
    from rclpy._graph_queries import NamesAndTypes


class NodeGraph(NodeNames):
    """Names, types and endpoints in the node's domain that discovery has found so far.

    Every query raises InvalidHandle if the node was destroyed, and RCLError after the shutdown.
    """

    _rclpy_graph: Graph

    def _rclpy_usable_graph(self) -> Graph:
        """The graph. Raises InvalidHandle or RCLError if the node cannot be used."""
        self._rclpy_check_usable()
        return self._rclpy_graph

    def get_node_names(self) -> list[str]:
        """Return the names of all nodes, without namespaces."""
        return [name for name, _, _ in self._rclpy_usable_graph().node_names()]

    def get_fully_qualified_node_names(self) -> list[str]:
        return _full_names(self._rclpy_usable_graph())

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        return [(name, namespace) for name, namespace, _ in self._rclpy_usable_graph().node_names()]

    def get_node_names_and_namespaces_with_enclaves(self) -> list[tuple[str, str, str]]:
        """Return name, namespace and enclave of every node."""
        return self._rclpy_usable_graph().node_names()

    def get_topic_names_and_types(self, no_demangle: bool = False) -> NamesAndTypes:
        """Return every topic with its types; with ``no_demangle``, every DDS topic by its DDS names."""
        return self._rclpy_usable_graph().topic_names_and_types(no_demangle)

    def get_service_names_and_types(self) -> NamesAndTypes:
        return self._rclpy_usable_graph().service_names_and_types()

    def get_publisher_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> NamesAndTypes:
        """Return the topics that a node publishes. Raises NodeNameNonExistentError if it is unknown."""
        return self._rclpy_usable_graph().publishers_of_node(node_name, node_namespace, no_demangle)

    def get_subscriber_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> NamesAndTypes:
        """Return the topics that a node subscribes to. Raises NodeNameNonExistentError if it is unknown."""
        return self._rclpy_usable_graph().subscriptions_of_node(node_name, node_namespace, no_demangle)

    def get_service_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """Return the services that a node serves. Raises NodeNameNonExistentError if it is unknown."""
        return self._rclpy_usable_graph().services_of_node(node_name, node_namespace)

    def get_client_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """Return the services that a node calls. Raises NodeNameNonExistentError if it is unknown."""
        return self._rclpy_usable_graph().clients_of_node(node_name, node_namespace)

    def count_publishers(self, topic_name: str) -> int:
        """Return the number of publishers on a topic; its name is not remapped."""
        return self._rclpy_usable_graph().count_writers(self._rclpy_counted_topic(topic_name))

    def count_subscribers(self, topic_name: str) -> int:
        return self._rclpy_usable_graph().count_readers(self._rclpy_counted_topic(topic_name))

    def count_services(self, service_name: str) -> int:
        return self._rclpy_usable_graph().count_readers(self._rclpy_counted_requests(service_name))

    def count_clients(self, service_name: str) -> int:
        return self._rclpy_usable_graph().count_writers(self._rclpy_counted_requests(service_name))

    def get_publishers_info_by_topic(
        self, topic_name: str, no_mangle: bool = False
    ) -> list[TopicEndpointInfo]:
        """Return the publishers on a topic; with ``no_mangle``, the topic's name is a DDS name."""
        found = self._rclpy_usable_graph().writers_of(self._rclpy_dds_topic(topic_name, no_mangle))
        return [_info(*one, TopicEndpointTypeEnum.PUBLISHER) for one in found]

    def get_subscriptions_info_by_topic(
        self, topic_name: str, no_mangle: bool = False
    ) -> list[TopicEndpointInfo]:
        """Return the subscriptions to a topic; with ``no_mangle``, the topic's name is a DDS name."""
        found = self._rclpy_usable_graph().readers_of(self._rclpy_dds_topic(topic_name, no_mangle))
        return [_info(*one, TopicEndpointTypeEnum.SUBSCRIPTION) for one in found]

    def _rclpy_dds_topic(self, name: str, no_mangle: bool = False) -> str:
        return name if no_mangle else _names.topic_to_dds(self._rclpy_remapped(name))

    def _rclpy_counted_topic(self, name: str) -> str:
        return _names.topic_to_dds(self._rclpy_expanded(name))

    def _rclpy_counted_requests(self, name: str) -> str:
        return _names.request_to_dds(self._rclpy_expanded(name, is_service=True))

    def wait_for_node(self, fully_qualified_node_name: str, timeout: float) -> bool:
        """Wait until a node exists; return ``False`` after ``timeout`` seconds."""
        name = "/" + fully_qualified_node_name.lstrip("/")
        graph = self._rclpy_usable_graph()
        return graph.wait_for(lambda: name in _full_names(graph), timeout, self.context.ok)


def _full_names(graph: Graph) -> list[str]:
    return [f"{namespace.rstrip('/')}/{name}" for name, namespace, _ in graph.node_names()]


def _info(
    endpoint: Endpoint, node_name: str, node_namespace: str, kind: TopicEndpointTypeEnum
) -> TopicEndpointInfo:
    return TopicEndpointInfo(
        node_name=node_name,
        node_namespace=node_namespace,
        topic_type=_names.type_from_dds(endpoint.type_name),
        topic_type_hash=TypeHash._rclpy_parse(user_data_value(endpoint.user_data, "typehash")),
        endpoint_type=kind,
        endpoint_gid=list(endpoint.gid),
        qos_profile=copy(endpoint.profile),  # the user may change it
    )
