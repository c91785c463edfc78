"""A buffer of transforms for a node."""

from __future__ import annotations

import threading
import time as system_time
from collections.abc import Callable
from typing import Any

from builtin_interfaces.msg import Time as TimeMsg
from geometry_msgs.msg import TransformStamped
from rclpy.clock import Clock, JumpThreshold, TimeJump
from rclpy.constants import S_TO_NS
from rclpy.duration import Duration
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.task import Future
from rclpy.time import Time
from tf2_msgs.srv import FrameGraph

from tf2_py import BufferCore, TransformException
from tf2_ros.buffer_interface import NO_WAIT, BufferInterface


class Buffer(BufferCore, BufferInterface):
    """Stores transforms and waits for them. A :class:`~tf2_ros.TransformListener` fills it.

    When time jumps back, or simulated time begins or ends, all but the static transforms are removed.
    """

    def __init__(self, cache_time: Duration | None = None, node: Node | None = None) -> None:
        """Create an empty buffer.

        :param cache_time: how long transforms are kept, 10 s by default.
        :param node: its clock detects jumps, and it gets the service ``tf2_frames``, which returns all frames
            as YAML.
        """
        BufferCore.__init__(self, cache_time)
        BufferInterface.__init__(self)
        self._tf2_new_data = threading.Condition(self._tf2_lock)
        self._tf2_pending: dict[Future, Callable[[], TransformStamped]] = {}
        if node is not None:
            self.srv = node.create_service(FrameGraph, "tf2_frames", self._tf2_on_frames_request)
            self.clock = node.get_clock()
        else:
            self.clock = Clock()
        threshold = JumpThreshold(min_forward=None, min_backward=Duration(seconds=-1), on_clock_change=True)
        self.jump_handle = self.clock.create_jump_callback(threshold, post_callback=self.time_jump_callback)

    def _tf2_on_frames_request(
        self, request: FrameGraph.Request, response: FrameGraph.Response
    ) -> FrameGraph.Response:
        response.frame_yaml = self.all_frames_as_yaml()
        return response

    def time_jump_callback(self, time_jump: TimeJump) -> None:
        """Remove all but the static transforms."""
        get_logger("tf2_buffer").warning("Detected jump back in time. Clearing tf buffer.")
        self.clear()

    def set_transform(self, transform: TransformStamped, authority: str) -> None:
        super().set_transform(transform, authority)
        self._tf2_on_new_data()

    def set_transform_static(self, transform: TransformStamped, authority: str) -> None:
        super().set_transform_static(transform, authority)
        self._tf2_on_new_data()

    def _tf2_on_new_data(self) -> None:
        """Wake the waiting threads, and complete the futures whose transform is known now."""
        results = []
        with self._tf2_new_data:
            self._tf2_new_data.notify_all()
            for future, lookup in list(self._tf2_pending.items()):
                try:
                    results.append((future, lookup()))
                except TransformException:
                    continue
                del self._tf2_pending[future]
        for future, transform in results:
            future.set_result(transform)

    def lookup_transform(
        self, target_frame: str, source_frame: str, time: Time | TimeMsg, timeout: Duration = NO_WAIT
    ) -> TransformStamped:
        """Return the transform, see ``BufferCore``; wait up to ``timeout`` while another thread spins."""
        self.can_transform(target_frame, source_frame, time, timeout)
        return self.lookup_transform_core(target_frame, source_frame, time)

    async def lookup_transform_async(
        self, target_frame: str, source_frame: str, time: Time | TimeMsg
    ) -> TransformStamped:
        """Wait until the transform is known, and return it."""
        await self.wait_for_transform_async(target_frame, source_frame, time)
        return self.lookup_transform_core(target_frame, source_frame, time)

    def lookup_transform_full(
        self,
        target_frame: str,
        target_time: Time | TimeMsg,
        source_frame: str,
        source_time: Time | TimeMsg,
        fixed_frame: str,
        timeout: Duration = NO_WAIT,
    ) -> TransformStamped:
        """Return the transform between two times, see ``BufferCore``; wait as in :meth:`lookup_transform`."""
        arguments = target_frame, target_time, source_frame, source_time, fixed_frame
        self.can_transform_full(*arguments, timeout)
        return self.lookup_transform_full_core(*arguments)

    async def lookup_transform_full_async(
        self,
        target_frame: str,
        target_time: Time | TimeMsg,
        source_frame: str,
        source_time: Time | TimeMsg,
        fixed_frame: str,
    ) -> TransformStamped:
        """Wait until the transform between two times is known, and return it."""
        arguments = target_frame, target_time, source_frame, source_time, fixed_frame
        await self.wait_for_transform_full_async(*arguments)
        return self.lookup_transform_full_core(*arguments)

    def can_transform(
        self,
        target_frame: str,
        source_frame: str,
        time: Time | TimeMsg,
        timeout: Duration = NO_WAIT,
        return_debug_tuple: bool = False,
    ) -> Any:
        """Return whether it is known within ``timeout``; ``return_debug_tuple`` adds the reason if not."""
        result = self._tf2_wait(lambda: self.can_transform_core(target_frame, source_frame, time), timeout)
        return result if return_debug_tuple else result[0]

    def can_transform_full(
        self,
        target_frame: str,
        target_time: Time | TimeMsg,
        source_frame: str,
        source_time: Time | TimeMsg,
        fixed_frame: str,
        timeout: Duration = NO_WAIT,
        return_debug_tuple: bool = False,
    ) -> Any:
        """Return whether the transform between two times is known; see :meth:`can_transform`."""
        arguments = target_frame, target_time, source_frame, source_time, fixed_frame
        result = self._tf2_wait(lambda: self.can_transform_full_core(*arguments), timeout)
        return result if return_debug_tuple else result[0]

    def _tf2_wait(self, can_transform: Callable[[], tuple[bool, str]], timeout: Duration) -> tuple[bool, str]:
        deadline = system_time.monotonic() + timeout.nanoseconds / S_TO_NS
        with self._tf2_new_data:
            while not (result := can_transform())[0]:
                remaining = deadline - system_time.monotonic()
                if remaining <= 0.0:
                    break
                self._tf2_new_data.wait(min(remaining, threading.TIMEOUT_MAX))
        return result

    def wait_for_transform_async(self, target_frame: str, source_frame: str, time: Time | TimeMsg) -> Future:
        """Return a future that gets the transform as soon as it is known."""
        return self._tf2_future(lambda: self.lookup_transform_core(target_frame, source_frame, time))

    def wait_for_transform_full_async(
        self,
        target_frame: str,
        target_time: Time | TimeMsg,
        source_frame: str,
        source_time: Time | TimeMsg,
        fixed_frame: str,
    ) -> Future:
        """Return a future that gets the transform between two times as soon as it is known."""
        arguments = target_frame, target_time, source_frame, source_time, fixed_frame
        return self._tf2_future(lambda: self.lookup_transform_full_core(*arguments))

    def _tf2_future(self, lookup: Callable[[], TransformStamped]) -> Future:
        future = Future()
        with self._tf2_lock:
            try:
                future.set_result(lookup())
            except TransformException:
                self._tf2_pending[future] = lookup
                future.add_done_callback(lambda done: self._tf2_pending.pop(done, None))  # if it is cancelled
        return future
