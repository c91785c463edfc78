"""What a node knows of the nodes, topics, services and actions of its domain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, TypeVar

from rclpy_ground.genuine import genuine
from rclpy_ground.interface import Discovery, Endpoint, NodeName, user_data_value

_T = TypeVar("_T")
_NamesAndTypes = list[tuple[str, list[str]]]
_FEEDBACK = "/_action/feedback"
_FEEDBACK_TYPE = "_FeedbackMessage_"
_PUBLISHER, _SUBSCRIPTION = 1, 2  # rmw_endpoint_type_t
_UNKNOWN = ("_NODE_NAME_UNKNOWN_", "_NODE_NAMESPACE_UNKNOWN_")
"""How rmw names the node of an endpoint that has none."""


class Graph:
    """The questions of a node about its domain."""

    _writers: Sequence[Endpoint] = ()
    _readers: Sequence[Endpoint] = ()
    _answers: dict[str, Any]

    def discovery(self) -> Discovery:
        raise NotImplementedError

    def answer(self, question: str, find: Callable[[list[Endpoint], list[Endpoint]], _T]) -> _T:
        """Return what is found among writers and readers; it is found once for each state of discovery."""
        discovery = self.discovery()
        writers, readers = discovery.writers(), discovery.readers()
        if writers is not self._writers or readers is not self._readers:
            self._writers, self._readers, self._answers = writers, readers, {}
        if question not in self._answers:
            self._answers[question] = find(writers, readers)
        found: _T = self._answers[question]
        return found

    def endpoints(self) -> list[Endpoint]:
        discovery = self.discovery()
        return discovery.writers() + discovery.readers()

    def readers_of(self, name: str, namespace: str) -> list[Endpoint]:
        return self._of_node(self.discovery().readers(), name, namespace)

    def writers_of(self, name: str, namespace: str) -> list[Endpoint]:
        return self._of_node(self.discovery().writers(), name, namespace)

    def _of_node(self, endpoints: list[Endpoint], name: str, namespace: str) -> list[Endpoint]:
        if (name, namespace) not in self.get_node_names_and_namespaces():
            raise genuine.NodeNameNonExistentError(
                f"cannot get the graph of {namespace} {name}: no such node"
            )
        return [each for each in endpoints if _node_of(each) == (name, namespace)]

    def writers_on(self, dds_name: str) -> list[Endpoint]:
        return self.answer("writers", lambda writers, _: _by_topic(writers)).get(dds_name, [])

    def readers_on(self, dds_name: str) -> list[Endpoint]:
        return self.answer("readers", lambda _, readers: _by_topic(readers)).get(dds_name, [])

    def get_count_publishers(self, name: str) -> int:
        return len(self.writers_on(f"rt{name}"))

    def get_count_subscribers(self, name: str) -> int:
        return len(self.readers_on(f"rt{name}"))

    def get_count_clients(self, name: str) -> int:
        return len(self.writers_on(f"rq{name}Request"))

    def get_count_services(self, name: str) -> int:
        return len(self.readers_on(f"rq{name}Request"))

    def get_node_names_and_namespaces_with_enclaves(self) -> list[tuple[str, str, str]]:
        enclaves = {
            gid: user_data_value(data, "enclave") for gid, data in self.discovery().participants().items()
        }
        nodes = {(each.participant, _owner(each)) for each in self.endpoints()}
        return sorted((node.name, node.namespace, enclaves.get(gid, "")) for gid, node in nodes if node)

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        return [each[:2] for each in self.get_node_names_and_namespaces_with_enclaves()]

    def get_action_names_and_types(self) -> _NamesAndTypes:
        return _actions(self.endpoints())

    def get_action_client_names_and_types_by_node(self, name: str, namespace: str) -> _NamesAndTypes:
        return _actions(self.readers_of(name, namespace))

    def get_action_server_names_and_types_by_node(self, name: str, namespace: str) -> _NamesAndTypes:
        return _actions(self.writers_of(name, namespace))


def _owner(endpoint: Endpoint) -> NodeName | None:
    """Return the node of an endpoint, if it has one that is known."""
    if endpoint.node is not None:
        return endpoint.node
    words = user_data_value(endpoint.user_data, "node").split(" ")
    return NodeName(*words) if len(words) == len(NodeName._fields) else None


def _node_of(endpoint: Endpoint) -> tuple[str, str] | None:
    """Return the name and the namespace of its node."""
    owner = _owner(endpoint)
    return owner and (owner.name, owner.namespace)


@cache
def _ros_type(type_name: str) -> str:
    return type_name.replace("::dds_::", "/").replace("::", "/").removesuffix("_")


def _names_and_types(pairs: list[tuple[str, str]]) -> _NamesAndTypes:
    found: dict[str, set[str]] = {}
    for name, type_name in pairs:
        found.setdefault(name, set()).add(type_name)
    return [(name, sorted(types)) for name, types in sorted(found.items())]


def _topics(endpoints: list[Endpoint], no_demangle: bool) -> _NamesAndTypes:
    if no_demangle:
        return _names_and_types([(each.topic, each.type_name) for each in endpoints])
    return _names_and_types(
        [(each.topic[2:], _ros_type(each.type_name)) for each in endpoints if each.topic.startswith("rt/")]
    )


def _services(endpoints: list[Endpoint]) -> _NamesAndTypes:
    return _names_and_types(
        [
            (each.topic[2:].removesuffix("Request"), _ros_type(each.type_name).rpartition("_")[0])
            for each in endpoints
            if each.topic.startswith("rq/") and each.topic.endswith("Request")
        ]
    )


def _actions(endpoints: list[Endpoint]) -> _NamesAndTypes:
    return _names_and_types(
        [
            (
                each.topic[2:].removesuffix(_FEEDBACK),
                _ros_type(each.type_name.removesuffix(_FEEDBACK_TYPE)),
            )
            for each in endpoints
            if each.topic.startswith("rt/") and each.topic.endswith(_FEEDBACK)
        ]
    )


def rclpy_get_topic_names_and_types(node: Graph, no_demangle: bool) -> _NamesAndTypes:
    found = node.answer(
        f"topics {no_demangle}", lambda writers, readers: _topics(writers + readers, no_demangle)
    )
    return [(name, [*types]) for name, types in found]


def rclpy_get_publisher_names_and_types_by_node(
    node: Graph, no_demangle: bool, name: str, namespace: str
) -> _NamesAndTypes:
    return _topics(node.writers_of(name, namespace), no_demangle)


def rclpy_get_subscriber_names_and_types_by_node(
    node: Graph, no_demangle: bool, name: str, namespace: str
) -> _NamesAndTypes:
    return _topics(node.readers_of(name, namespace), no_demangle)


def rclpy_get_service_names_and_types(node: Graph) -> _NamesAndTypes:
    return _services(node.discovery().readers())


def rclpy_get_service_names_and_types_by_node(node: Graph, name: str, namespace: str) -> _NamesAndTypes:
    return _services(node.readers_of(name, namespace))


def rclpy_get_client_names_and_types_by_node(node: Graph, name: str, namespace: str) -> _NamesAndTypes:
    return _services(node.writers_of(name, namespace))


def rclpy_get_publishers_info_by_topic(node: Graph, topic: str, no_mangle: bool) -> list[dict[str, Any]]:
    writers = node.writers_on(_dds_name(topic, no_mangle))
    return [_info(each, _PUBLISHER, no_mangle) for each in writers]


def rclpy_get_subscriptions_info_by_topic(node: Graph, topic: str, no_mangle: bool) -> list[dict[str, Any]]:
    readers = node.readers_on(_dds_name(topic, no_mangle))
    return [_info(each, _SUBSCRIPTION, no_mangle) for each in readers]


def _by_topic(endpoints: list[Endpoint]) -> dict[str, list[Endpoint]]:
    found: dict[str, list[Endpoint]] = {}
    for each in endpoints:
        found.setdefault(each.topic, []).append(each)
    return found


def _dds_name(topic: str, no_mangle: bool) -> str:
    return topic if no_mangle else f"rt{topic}"


def _info(endpoint: Endpoint, kind: int, no_mangle: bool) -> dict[str, Any]:
    name, namespace = _node_of(endpoint) or _UNKNOWN
    hash_ = user_data_value(endpoint.user_data, "typehash")
    value = bytes.fromhex(hash_.partition("_")[2]) if hash_ else bytes(32)
    profile: Any = endpoint.profile
    return {
        "node_name": name,
        "node_namespace": namespace,
        "topic_type": endpoint.type_name if no_mangle else _ros_type(endpoint.type_name),
        "topic_type_hash": {"version": 1 if hash_ else 0, "value": value},
        "endpoint_type": kind,
        "endpoint_gid": list(endpoint.gid),
        "qos_profile": profile.get_c_qos_profile().to_dict(),
    }
