"""Nodes: their names, their endpoints and their parameters."""

from __future__ import annotations

from typing import Any

from rclpy_ground import choice
from rclpy_ground.contexts import Context
from rclpy_ground.genuine import RCLError, genuine
from rclpy_ground.graph import Graph
from rclpy_ground.handles import Destroyable
from rclpy_ground.interface import Discovery, Reader, Writer
from rclpy_ground.messages import type_of
from rclpy_ground.parameters import parameters
from rclpy_ground.rcl import Arguments, remap, remap_node
from rclpy_ground.type_descriptions import TypeSupport


class Node(Graph, Destroyable):
    """A node; :class:`rclpy_ground.rosout.Node` is what rclpy gets."""

    def __init__(
        self,
        name: str,
        namespace: str,
        context: Context,
        cli_args: list[str] | None,
        use_global_arguments: bool,
    ) -> None:
        if genuine.rclpy_get_validation_error_for_node_name(name):
            raise ValueError(f"invalid node name: {name}")
        namespace = namespace if namespace.startswith("/") else f"/{namespace}"
        if genuine.rclpy_get_validation_error_for_namespace(namespace):
            raise ValueError(f"invalid node namespace: {namespace}")
        self._arguments = Arguments(list(cli_args or ()))
        self._shared = context.arguments if use_global_arguments else None
        self.name, self.namespace = remap_node(self._arguments, self._shared, name, namespace)
        self.fqn = f"{self.namespace.rstrip('/')}/{self.name}"
        self.logger = self.fqn[1:].replace("/", ".")
        self.context = context
        self.participant = context.join()
        self.types: dict[str, TypeSupport] = {}
        """The types that it uses, by their hash."""
        super().__init__()

    def check_context(self) -> None:
        """Raise RCLError after the shutdown of its context."""
        if not self.context.is_valid:
            raise RCLError("rcl node's context is invalid")

    def note_type(self, type_: Any, kind: str) -> None:
        """Note that it uses a message, service or action."""
        support = TypeSupport(type_, kind)
        self.types[support.hash()] = support

    def expand(self, name: str) -> str:
        """Return the full name of a topic or service before it is remapped."""
        fqn: str = genuine.rclpy_expand_topic_name(name, self.name, self.namespace)
        return fqn

    def resolve(self, name: str, *, is_service: bool) -> str:
        """Return the full name of a topic or service after it is remapped."""
        return self.remap(self.expand(name), is_service=is_service)

    def remap(self, fqn: str, *, is_service: bool) -> str:
        return remap(self._arguments, self._shared, fqn, self.name, self.namespace, is_service=is_service)

    def create_writer(self, topic: str, message: Any, profile: Any, extra: str = "") -> Writer:
        """Create a writer of a message type; ``extra`` goes to its USER_DATA."""
        type_name, hash_ = type_of(message)
        return self.participant.create_writer(topic, type_name, profile, self._user_data(hash_, extra))

    def create_reader(self, topic: str, message: Any, profile: Any, extra: str = "") -> Reader:
        """Create a reader of a message type; ``extra`` goes to its USER_DATA."""
        type_name, hash_ = type_of(message)
        return self.participant.create_reader(topic, type_name, profile, self._user_data(hash_, extra))

    def _user_data(self, hash_: str, extra: str) -> str:
        return f"{extra}node={self.namespace} {self.name} {self.pointer};typehash={hash_};"

    def discovery(self) -> Discovery:
        self.check_context()
        choice.ground.note_poll()
        return self.participant.create_discovery()

    def get_fully_qualified_name(self) -> str:
        return self.fqn

    def logger_name(self) -> str:
        return self.logger

    def get_node_name(self) -> str:
        return self.name

    def get_namespace(self) -> str:
        return self.namespace

    def get_parameters(self, parameter: Any) -> dict[str, Any]:
        """Return what the ROS arguments set, as objects of a class (``rclpy.parameter.Parameter``)."""
        found = parameters(self._shared, self.fqn) if self._shared else {}
        found |= parameters(self._arguments, self.fqn)
        return {name: parameter(name, parameter.Type(kind), value) for name, (kind, value) in found.items()}

    def destroy(self) -> None:
        self.context.leave()


def rclpy_resolve_name(node: Node, name: str, only_expand: bool, is_service: bool) -> str:
    try:
        fqn = node.expand(name) if only_expand else node.resolve(name, is_service=is_service)
        if genuine.rclpy_get_validation_error_for_full_topic_name(fqn):
            raise ValueError("it is no valid fully qualified name")
    except ValueError as error:
        raise RCLError(f"failed to resolve name {name}: {error}") from None
    return fqn


def rclpy_remap_topic_name(node: Node, name: str) -> str:
    return node.remap(name, is_service=False)


def rclpy_get_rmw_implementation_identifier() -> str:
    return choice.ground.name
