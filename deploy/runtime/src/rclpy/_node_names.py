"""The part of `Node` that concerns names: its own, and the resolution of topic and service names."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy._handle import Handle
from rclpy.exceptions import InvalidHandle, NameValidationException, RCLError
from rclpy.expand_topic_name import expand_topic_name
from rclpy.validate_full_topic_name import validate_full_topic_name

if TYPE_CHECKING:
    from rclpy._arguments import RosArguments
    from rclpy.context import Context


class NodeNames:
    """The node's name, and the expanded and remapped names of its topics and services.

    Subclasses by users may use any private name that rclpy's `Node` does not have. To avoid collisions, the
    private names that only this runtime has begin with ``_rclpy_``, in all parts of `Node`.
    """

    _context: Context
    _rclpy_arguments: RosArguments
    _rclpy_name: str
    _rclpy_namespace: str
    _rclpy_fully_qualified_name: str
    _rclpy_destroyed = False

    @property
    def context(self) -> Context:
        return self._context

    @property
    def handle(self) -> Handle:
        """A handle for the node. Raises InvalidHandle if the node was destroyed."""
        self._rclpy_check_exists()
        return Handle()

    def _rclpy_check_exists(self) -> None:
        if self._rclpy_destroyed:
            raise InvalidHandle(f"cannot use node {self._rclpy_fully_qualified_name}: it was destroyed")

    def _rclpy_check_usable(self) -> None:
        """Raise InvalidHandle if the node was destroyed, RCLError if its context was shut down."""
        self._rclpy_check_exists()
        if not self._context.ok():
            raise RCLError(f"cannot use node {self._rclpy_fully_qualified_name}: the context was shut down")

    def get_name(self) -> str:
        return self._rclpy_name

    def get_namespace(self) -> str:
        return self._rclpy_namespace

    def get_fully_qualified_name(self) -> str:
        return self._rclpy_fully_qualified_name

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:
        """Return a topic's full name, remapped unless ``only_expand``. Raises RCLError if it is invalid."""
        return self._rclpy_resolve(topic, only_expand, is_service=False)

    def resolve_service_name(self, service: str, *, only_expand: bool = False) -> str:
        """Return a service's full name, remapped unless ``only_expand``. Raises RCLError if it is invalid."""
        return self._rclpy_resolve(service, only_expand, is_service=True)

    def _rclpy_resolve(self, name: str, only_expand: bool, *, is_service: bool) -> str:
        try:
            expand = self._rclpy_expanded if only_expand else self._rclpy_remapped
            return expand(name, is_service=is_service)
        except (ValueError, NameValidationException) as error:
            raise RCLError(f"failed to resolve name: {error}") from error

    def _rclpy_expanded(self, name: str, *, is_service: bool = False) -> str:
        """Return the fully qualified name of a topic or service.

        :raises ValueError: if the given name is invalid.
        :raises InvalidTopicNameException, InvalidServiceNameException: if the expanded name is invalid.
        """
        expanded = expand_topic_name(name, self._rclpy_name, self._rclpy_namespace)
        validate_full_topic_name(expanded, is_service=is_service)
        return expanded

    def _rclpy_remapped(self, name: str, *, is_service: bool = False) -> str:
        """Return the fully qualified, remapped name; errors as in :meth:`_rclpy_expanded`."""
        remap = self._rclpy_arguments.remap_service if is_service else self._rclpy_arguments.remap_topic
        return remap(
            self._rclpy_expanded(name, is_service=is_service), self._rclpy_name, self._rclpy_namespace
        )
