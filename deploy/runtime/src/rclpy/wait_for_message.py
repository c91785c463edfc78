"""Waits for a single message of a topic."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from rclpy.callback_groups import ReentrantCallbackGroup, _as_default
from rclpy.exceptions import NotInitializedException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import QoSProfile
from rclpy.task import Future

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.subscription import Subscription


def wait_for_message(
    msg_type: Any,
    node: Node,
    topic: str,
    *,
    qos_profile: QoSProfile | int = 1,
    time_to_wait: float | int = -1,
) -> tuple[bool, Any]:
    """Wait for the next message on `topic`, at most `time_to_wait` seconds; negative: no limit.

    No other callback of the node runs during the wait, unless another thread spins the node.

    :returns: `True` and the message, or `False` and `None` after a timeout or the shutdown of the context.
    """
    message = Future()
    # A separate group: the caller may be a callback of the node's default group.
    with _as_default(ReentrantCallbackGroup()):
        subscription = node.create_subscription(msg_type, topic, message.set_result, qos_profile=qos_profile)
    try:
        with SingleThreadedExecutor(context=node.context) as executor:
            executor.add_node(cast("Node", _NodeWithOneSubscription(subscription)))
            executor.spin_until_future_complete(message, None if time_to_wait < 0 else time_to_wait)
    except (ExternalShutdownException, NotInitializedException):
        pass  # shut down during or before the wait
    finally:
        node.destroy_subscription(subscription)
    return (True, message.result()) if message.done() else (False, None)


class _NodeWithOneSubscription:
    timers = ()
    guards = ()
    _rclpy_added_waitables = ()
    executor = None
    _rclpy_entities_version = 0

    def __init__(self, subscription: Subscription) -> None:
        self._subscription = subscription

    def _rclpy_waitables(self) -> list[Subscription]:
        return [self._subscription]
