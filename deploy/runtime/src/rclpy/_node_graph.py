"""What a node can ask about the graph: the part of `Node` that looks at others."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy import _names
from rclpy._dds.discovery import Endpoint
from rclpy._dds.qos import user_data_value
from rclpy.exceptions import NameValidationException
from rclpy.topic_endpoint_info import TopicEndpointInfo, TopicEndpointTypeEnum
from rclpy.type_hash import TypeHash

if TYPE_CHECKING:
    from rclpy._graph import Graph, NamesAndTypes
    from rclpy.context import Context


class NodeGraph:
    """Names, types and endpoints in the node's domain, as far as discovery has found them by now."""

    _graph: Graph

    @property
    def context(self) -> Context:
        """The context of the node."""
        raise NotImplementedError

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:
        """Return the fully qualified name of a topic of the node."""
        raise NotImplementedError

    def resolve_service_name(self, service: str, *, only_expand: bool = False) -> str:
        """Return the fully qualified name of a service of the node."""
        raise NotImplementedError

    def get_node_names(self) -> list[str]:
        """Return the names of all nodes, without namespaces."""
        return [name for name, _, _ in self._graph.node_names()]

    def get_fully_qualified_node_names(self) -> list[str]:
        """Return the names of all nodes, with their namespaces."""
        return [f"{namespace.rstrip('/')}/{name}" for name, namespace, _ in self._graph.node_names()]

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """Return name and namespace of every node."""
        return [(name, namespace) for name, namespace, _ in self._graph.node_names()]

    def get_node_names_and_namespaces_with_enclaves(self) -> list[tuple[str, str, str]]:
        """Return name, namespace and enclave of every node."""
        return self._graph.node_names()

    def get_topic_names_and_types(self, no_demangle: bool = False) -> NamesAndTypes:
        """Return every topic with its types; with ``no_demangle`` by its DDS names, ROS or not."""
        return self._graph.topic_names_and_types(no_demangle)

    def get_service_names_and_types(self) -> NamesAndTypes:
        """Return every service with its types."""
        return self._graph.service_names_and_types()

    def get_publisher_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> NamesAndTypes:
        """Return the topics that a node publishes. Raises NodeNameNonExistentError if it is not known."""
        return self._graph.publishers_of_node(node_name, node_namespace, no_demangle)

    def get_subscriber_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> NamesAndTypes:
        """Return the topics that a node subscribes to. Raises NodeNameNonExistentError if it is not known."""
        return self._graph.subscriptions_of_node(node_name, node_namespace, no_demangle)

    def get_service_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """Return the services that a node serves. Raises NodeNameNonExistentError if it is not known."""
        return self._graph.services_of_node(node_name, node_namespace)

    def get_client_names_and_types_by_node(self, node_name: str, node_namespace: str) -> NamesAndTypes:
        """Return the services that a node calls. Raises NodeNameNonExistentError if it is not known."""
        return self._graph.clients_of_node(node_name, node_namespace)

    def count_publishers(self, topic_name: str) -> int:
        """Return how many publishers a topic has."""
        return self._graph.count_writers(self._dds_topic(topic_name))

    def count_subscribers(self, topic_name: str) -> int:
        """Return how many subscriptions a topic has."""
        return self._graph.count_readers(self._dds_topic(topic_name))

    def count_services(self, service_name: str) -> int:
        """Return how many servers a service has."""
        return self._graph.count_readers(self._dds_requests(service_name))

    def count_clients(self, service_name: str) -> int:
        """Return how many clients a service has."""
        return self._graph.count_writers(self._dds_requests(service_name))

    def get_publishers_info_by_topic(
        self, topic_name: str, no_mangle: bool = False
    ) -> list[TopicEndpointInfo]:
        """Return who publishes a topic, and how; with ``no_mangle`` the topic's name is a DDS name."""
        found = self._graph.writers_of(self._dds_topic(topic_name, no_mangle))
        return [_info(*one, TopicEndpointTypeEnum.PUBLISHER) for one in found]

    def get_subscriptions_info_by_topic(
        self, topic_name: str, no_mangle: bool = False
    ) -> list[TopicEndpointInfo]:
        """Return who subscribes to a topic, and how; with ``no_mangle`` the topic's name is a DDS name."""
        found = self._graph.readers_of(self._dds_topic(topic_name, no_mangle))
        return [_info(*one, TopicEndpointTypeEnum.SUBSCRIPTION) for one in found]

    def _dds_topic(self, name: str, no_mangle: bool = False) -> str:
        try:
            return name if no_mangle else _names.topic_to_dds(self.resolve_topic_name(name))
        except NameValidationException as error:
            raise ValueError(f"topic name '{name}' is invalid: {error}") from error

    def _dds_requests(self, name: str) -> str:
        try:
            return _names.request_to_dds(self.resolve_service_name(name))
        except NameValidationException as error:
            raise ValueError(f"service name '{name}' is invalid: {error}") from error

    def wait_for_node(self, fully_qualified_node_name: str, timeout: float) -> bool:
        """Wait until a node is there; ``False`` if that takes longer than ``timeout`` seconds."""
        name = "/" + fully_qualified_node_name.lstrip("/")
        return self._graph.wait_for(
            lambda: name in self.get_fully_qualified_node_names(), timeout, self.context.ok
        )


def _info(
    endpoint: Endpoint, node_name: str, node_namespace: str, kind: TopicEndpointTypeEnum
) -> TopicEndpointInfo:
    return TopicEndpointInfo(
        node_name=node_name,
        node_namespace=node_namespace,
        topic_type=_names.type_from_dds(endpoint.type_name),
        topic_type_hash=TypeHash._parse(user_data_value(endpoint.user_data, "typehash")),
        endpoint_type=kind,
        endpoint_gid=list(endpoint.gid),
        qos_profile=endpoint.profile,
    )
