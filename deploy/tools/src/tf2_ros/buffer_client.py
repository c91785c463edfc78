"""A buffer of transforms in another process, behind an action."""

from __future__ import annotations

import threading
import time as system_time
from typing import Any

from builtin_interfaces.msg import Time as TimeMsg
from geometry_msgs.msg import TransformStamped
from rclpy.action.client import ActionClient
from rclpy.constants import S_TO_NS
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.task import Future
from rclpy.time import Time
from tf2_msgs.action import LookupTransform
from tf2_msgs.msg import TF2Error

from tf2_py import (
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    TimeoutException,
    TransformException,
)
from tf2_ros.buffer_interface import NO_WAIT, BufferInterface

_PADDING = Duration(seconds=2.0)
_EXCEPTIONS = {
    TF2Error.LOOKUP_ERROR: LookupException,
    TF2Error.CONNECTIVITY_ERROR: ConnectivityException,
    TF2Error.EXTRAPOLATION_ERROR: ExtrapolationException,
    TF2Error.INVALID_ARGUMENT_ERROR: InvalidArgumentException,
    TF2Error.TIMEOUT_ERROR: TimeoutException,
}


class BufferClient(BufferInterface):
    """Asks the buffer of a buffer server (``tf2_msgs/action/LookupTransform``) for transforms.

    Its methods wait for the server: another thread must spin the node meanwhile.
    """

    def __init__(
        self,
        node: Node,
        ns: str,
        check_frequency: float = 10.0,
        timeout_padding: Duration | float = _PADDING,
    ) -> None:
        """Create a client.

        :param ns: the name of the action.
        :param check_frequency: not used: the client does not poll.
        :param timeout_padding: how much longer than the timeout of a lookup to wait for the server, as a
            duration or in seconds.
        """
        super().__init__()
        self.node = node
        self.action_client = ActionClient(node, LookupTransform, action_name=ns)
        self.check_frequency = check_frequency
        self.timeout_padding = timeout_padding

    def lookup_transform(
        self, target_frame: str, source_frame: str, time: Time | TimeMsg, timeout: Duration = NO_WAIT
    ) -> TransformStamped:
        """Return the transform from ``source_frame`` to ``target_frame``.

        :param timeout: how long the server may wait for it.
        :raises TypeError: if the time is no time.
        :raises TransformException: as ``BufferCore.lookup_transform_core``; its subclass TimeoutException if
            there is no server or no answer.
        """
        return self._tf2_ask(
            LookupTransform.Goal(
                target_frame=target_frame,
                source_frame=source_frame,
                source_time=_message(time),
                timeout=timeout.to_msg(),
            )
        )

    def lookup_transform_full(
        self,
        target_frame: str,
        target_time: Time | TimeMsg,
        source_frame: str,
        source_time: Time | TimeMsg,
        fixed_frame: str,
        timeout: Duration = NO_WAIT,
    ) -> TransformStamped:
        """Return the transform between two times, see :meth:`lookup_transform`."""
        return self._tf2_ask(
            LookupTransform.Goal(
                target_frame=target_frame,
                source_frame=source_frame,
                source_time=_message(source_time),
                timeout=timeout.to_msg(),
                target_time=_message(target_time),
                fixed_frame=fixed_frame,
                advanced=True,
            )
        )

    def can_transform(
        self, target_frame: str, source_frame: str, time: Time | TimeMsg, timeout: Duration = NO_WAIT
    ) -> bool:
        try:
            self.lookup_transform(target_frame, source_frame, time, timeout)
        except TransformException:
            return False
        return True

    def can_transform_full(
        self,
        target_frame: str,
        target_time: Time | TimeMsg,
        source_frame: str,
        source_time: Time | TimeMsg,
        fixed_frame: str,
        timeout: Duration = NO_WAIT,
    ) -> bool:
        try:
            self.lookup_transform_full(
                target_frame, target_time, source_frame, source_time, fixed_frame, timeout
            )
        except TransformException:
            return False
        return True

    def destroy(self) -> None:
        self.action_client.destroy()

    def _tf2_ask(self, goal: Any) -> TransformStamped:
        if not self.action_client.server_is_ready():
            raise TimeoutException("The BufferServer is not ready.")
        padding = self.timeout_padding
        seconds = padding.nanoseconds / S_TO_NS if isinstance(padding, Duration) else padding
        seconds += Duration.from_msg(goal.timeout).nanoseconds / S_TO_NS
        deadline = system_time.monotonic() + seconds
        handle = _result(self.action_client.send_goal_async(goal), deadline)
        if not handle.accepted:
            raise TimeoutException("The BufferServer did not accept the LookupTransform goal.")
        result = _result(handle.get_result_async(), deadline).result
        if result.error.error == TF2Error.NO_ERROR:
            transform: TransformStamped = result.transform
            return transform
        raise _EXCEPTIONS.get(result.error.error, TransformException)(result.error.error_string)


def _message(time: Time | TimeMsg) -> TimeMsg:
    if isinstance(time, Time):
        return time.to_msg()
    if isinstance(time, TimeMsg):
        return time
    raise TypeError("Must pass a rclpy.time.Time object.")


def _result(future: Future, deadline: float) -> Any:
    """Wait for a result until a time of the monotonic clock [s]. Raises TimeoutException."""
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    if not done.wait(min(max(0.0, deadline - system_time.monotonic()), threading.TIMEOUT_MAX)):
        raise TimeoutException(
            "The LookupTransform goal sent to the BufferServer did not come back in the specified time. "
            "Something is likely wrong with the server."
        )
    return future.result()
