"""One message of a topic, without a subscription of one's own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from rclpy.callback_groups import ReentrantCallbackGroup
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
    """
    Wait for the next message on `topic`, at most `time_to_wait` seconds; negative: as long as it takes.

    Nothing else of the node runs meanwhile, unless it spins on another thread.

    :returns: `True` and the message; `False` and `None` if none came in time or the context was shut down.
    """
    message = Future()
    subscription = node.create_subscription(
        msg_type,
        topic,
        message.set_result,
        qos_profile,
        # Of its own: the caller may be a callback of the node's default group.
        callback_group=ReentrantCallbackGroup(),
    )
    try:
        with SingleThreadedExecutor(context=node.context) as executor:
            executor.add_node(cast("Node", _NodeWithOnly(subscription)))
            executor.spin_until_future_complete(message, None if time_to_wait < 0 else time_to_wait)
    except (ExternalShutdownException, NotInitializedException):  # the latter: before there was the executor
        pass
    finally:
        node.destroy_subscription(subscription)
    return (True, message.result()) if message.done() else (False, None)


class _NodeWithOnly:
    """What an executor sees of a node, with one subscription to wait for."""

    timers = ()
    guards = ()
    executor = None
    _rclpy_entities_version = 0

    def __init__(self, subscription: Subscription) -> None:
        self._subscription = subscription

    def _rclpy_waitables(self) -> list[Subscription]:
        return [self._subscription]
