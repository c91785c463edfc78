"""Lifecycle nodes: not there. Every name can be imported, and raises NotImplementedError when used."""

from __future__ import annotations

from rclpy._not_there import NotThere


class LifecycleNodeMixin(NotThere):
    """Not there."""


class LifecycleNode(NotThere):
    """Not there."""


class LifecycleState(NotThere):
    """Not there."""


class LifecyclePublisher(NotThere):
    """Not there."""


class ManagedEntity(NotThere):
    """Not there."""


class SimpleManagedEntity(NotThere):
    """Not there."""


class TransitionCallbackReturn(NotThere):
    """Not there."""


# The short names by which rclpy.lifecycle has them, too.
Node = LifecycleNode
NodeMixin = LifecycleNodeMixin
State = LifecycleState
Publisher = LifecyclePublisher
