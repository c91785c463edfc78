"""The other users of the topics and services of a node: other types, rivals and loops in the graph."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any

from rclpy.qos import DurabilityPolicy as Durability
from rclpy.qos import ReliabilityPolicy as Reliability

from interfaces.service.errors import UserError
from interfaces.topics import ROWS, Topic
from reactive_node import ReactiveNode
from reactive_node.strangers import Endpoint

_PATIENCE = 30
"""Looks, one each second: a node's name comes later than its endpoints, and what has died stays for 20 s."""
_UNNAMED = "_NODE_NAME_UNKNOWN_"  # of an endpoint in the graph
_WITHOUT_NODE = "a program without a node"
_CONTRACT = {topic.name for topic in ROWS}


def real_name(node: ReactiveNode, topic: Topic) -> str:
    """Return the name of a topic as its user knows it: that of the row, or what it is remapped to."""
    name = node.resolve_topic_name(topic.name)
    return topic.name if name == topic.full_name(node.get_namespace()) else name


class Peers:
    """The others on the topics and services of a node."""

    def __init__(self, node: ReactiveNode) -> None:
        self._node = node
        self._inputs: dict[str, Topic] = {}  # by resolved name
        self._outputs: dict[str, Topic] = {}
        self._doubts: Counter[str] = Counter()  # looks at an output whose rival has no name of its own

    def reads(self, topic: Topic) -> None:
        """Add an input of the node. Raises UserError if the node would hear itself."""
        self._inputs[self._node.resolve_topic_name(topic.name)] = topic
        self._refuse_loops()

    def writes(self, topic: Topic) -> None:
        """Add an output of the node. Raises UserError if the node would hear itself."""
        self._outputs[self._node.resolve_topic_name(topic.name)] = topic
        self._refuse_loops()

    def publishers(self, topic: Topic) -> set[str]:
        """Return the names of the nodes that publish a topic."""
        return self._named(self._node.publishers_of(self._node.resolve_topic_name(topic.name)))

    def _refuse_loops(self) -> None:
        for name in self._inputs.keys() & self._outputs.keys():
            read, written = self._inputs[name].name, self._outputs[name].name
            if read != written:
                raise UserError(f"{read}: {name} is what {written} publishes; remap one of them")

    def problems(self) -> Iterator[tuple[str, str]]:
        """Yield what is wrong: the name of a topic or service, and the reason."""
        types = self._node.topic_types()
        for name, topic in self._inputs.items():
            if types.get(name) != [topic.type_name]:  # to ask for each topic's publishers would cost more
                for it in self._node.publishers_of(name):
                    if it.type != topic.type_name:
                        what = f"{self._shown(it)} publishes {it.type or 'another type'}"
                        yield real_name(self._node, topic), what
        matched = {it.topic_name: it.get_subscription_count() for it in self._node.publishers}
        for name, topic in self._outputs.items():
            if self._node.count_subscribers(name) > matched.get(name, 0):  # their details would cost more
                for it in self._node.subscribers_of(name):
                    if expected := _mismatch(it, topic):
                        yield real_name(self._node, topic), f"{self._shown(it)} expects {expected}"
            for rival in self._rivals(name, topic, int(name in matched)):
                yield real_name(self._node, topic), f"{rival} publishes it, too"
        yield from self._loops()
        yield from self._services()

    def _rivals(self, name: str, topic: Topic, own: int) -> Iterator[str]:
        """Yield who publishes an output of which the contract knows one publisher.

        :param own: how many publishers of it the node has.
        """
        is_shared = len(topic.publishers) != 1 or topic.name[0] == "/"
        if is_shared or self._node.count_publishers(name) <= own:
            return
        others = [it for it in self._node.publishers_of(name) if it.namespace]
        named = {self._shown(it) for it in others if it.node != _UNNAMED and not self._is_own(it)}
        yield from sorted(named)
        doubtful = Counter(it.node for it in others if it.node == _UNNAMED or self._is_own(it))
        doubtful[self._node.get_name()] -= own
        self._doubts[name] = self._doubts[name] + 1 if any(n > 0 for n in doubtful.values()) else 0
        if self._doubts[name] >= _PATIENCE:
            yield _WITHOUT_NODE if doubtful[_UNNAMED] else f"another {self._node.get_name()}"

    def _loops(self) -> Iterator[tuple[str, str]]:
        """Yield the nodes through which an output may come back. Loops within the contract are intended."""
        for name, topic in self._inputs.items():
            for output, written in self._outputs.items():
                if topic.name not in _CONTRACT and topic.type is written.type and output != name:
                    readers = self._named(self._node.subscribers_of(output))
                    for node in sorted(readers & self.publishers(topic)):
                        loop = f"{node} reads {real_name(self._node, written)} and publishes this: a loop"
                        yield real_name(self._node, topic), loop

    def _services(self) -> Iterator[tuple[str, str]]:
        """Yield which services have another type: nothing answers a request of ours."""
        waiting = {it.srv_name: it.srv_type for it in self._node.clients if not it.service_is_ready()}
        types = self._node.service_types() if waiting else {}
        for name, srv_type in waiting.items():
            wanted = _type_name(srv_type)
            if found := {*types.get(self._node.resolve_service_name(name), ())} - {wanted}:
                yield name, f"it is a {', '.join(sorted(found))}, not a {wanted}"

    def _is_own(self, endpoint: Endpoint) -> bool:
        return (endpoint.node, endpoint.namespace) == (self._node.get_name(), self._node.get_namespace())

    def _named(self, endpoints: Iterable[Endpoint]) -> set[str]:
        return {self._shown(it) for it in endpoints if it.namespace and it.node != _UNNAMED}

    def _shown(self, endpoint: Endpoint) -> str:
        """Return the name of the node of an endpoint, in full if it is in another namespace."""
        if endpoint.node == _UNNAMED:
            return _WITHOUT_NODE
        if endpoint.namespace in ("", self._node.get_namespace()):
            return endpoint.node
        return f"{endpoint.namespace.rstrip('/')}/{endpoint.node}"


def _mismatch(subscriber: Endpoint, topic: Topic) -> str:
    """Return what a subscriber expects instead of a topic, and so gets nothing; empty if it gets all."""
    if subscriber.type != topic.type_name or subscriber.qos is None:
        return subscriber.type
    wanted, given = subscriber.qos, topic.qos
    if wanted.reliability == Reliability.RELIABLE and given.reliability == Reliability.BEST_EFFORT:
        return "a reliable publisher"
    if wanted.durability == Durability.TRANSIENT_LOCAL and given.durability == Durability.VOLATILE:
        return "a transient local publisher"
    return ""


def _type_name(srv_type: Any) -> str:
    package, kind = srv_type.__module__.split(".")[:2]
    return f"{package}/{kind}/{srv_type.__name__}"
