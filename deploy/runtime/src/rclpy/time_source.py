"""Simulated time: clocks follow `/clock` while the parameter `use_sim_time` of their node is true."""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING

from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, _as_default
from rclpy.clock import Clock, ROSClock
from rclpy.clock_type import ClockType
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time

if TYPE_CHECKING:
    import rosgraph_msgs.msg
    from rclpy.node import Node
    from rclpy.subscription import Subscription
    from rclpy.timer import Timer

CLOCK_TOPIC = "/clock"
USE_SIM_TIME_NAME = "use_sim_time"
CLOCK_TIMEOUT = 2.0  # s of steady time without a message on /clock until a warning


class TimeSource:
    """Sets the attached clocks to the time that a simulator publishes."""

    def __init__(self, *, node: Node | None = None) -> None:
        self._clock_sub: Subscription | None = None
        self._rclpy_timeout: Timer | None = None
        self._node_weak_ref: weakref.ReferenceType[Node] | None = None
        self._associated_clocks: dict[ROSClock, None] = {}  # in order
        # Zero: no time was received.
        self._last_time_set = Time(clock_type=ClockType.ROS_TIME)
        self._ros_time_is_active = False
        if node is not None:
            self.attach_node(node)

    @property
    def ros_time_is_active(self) -> bool:
        """Whether the clocks follow `/clock`. Can be set."""
        return self._ros_time_is_active

    @ros_time_is_active.setter
    def ros_time_is_active(self, enabled: bool) -> None:
        if self._ros_time_is_active == enabled:
            return
        self._ros_time_is_active = enabled
        for clock in self._associated_clocks:
            clock._set_ros_time_is_active(enabled)
        if enabled:
            self._rclpy_subscribe()
        else:
            self._rclpy_unsubscribe()

    def attach_node(self, node: Node) -> None:
        """Follow `use_sim_time` of `node`; declare it if necessary. Raises TypeError if it is no node."""
        from rclpy.node import Node

        if not isinstance(node, Node):
            raise TypeError("Node must be of type rclpy.node.Node")
        if self._node_weak_ref is not None:
            self.detach_node()
        self._node_weak_ref = weakref.ref(node)

        if not node.has_parameter(USE_SIM_TIME_NAME):
            node.declare_parameter(USE_SIM_TIME_NAME, False)
        parameter = node.get_parameter(USE_SIM_TIME_NAME)
        if parameter.type_ is Parameter.Type.BOOL:
            self.ros_time_is_active = parameter.value
        elif parameter.type_ is not Parameter.Type.NOT_SET:
            node.get_logger().error(
                f"Invalid type for parameter '{USE_SIM_TIME_NAME}' {parameter.type_!r} should be bool"
            )
        node.add_on_set_parameters_callback(self._rclpy_check)
        node._post_set_parameters_callbacks.insert(0, self._rclpy_follow)

    def detach_node(self) -> None:
        node = self._get_node()
        self._rclpy_unsubscribe()
        if node is not None:
            node.remove_on_set_parameters_callback(self._rclpy_check)
            node._post_set_parameters_callbacks.remove(self._rclpy_follow)
        self._node_weak_ref = None

    def attach_clock(self, clock: ROSClock) -> None:
        """Attach a clock. Raises ValueError if it is not a clock of ROS time."""
        if not isinstance(clock, ROSClock):
            raise ValueError("Only clocks with type ROS_TIME can be attached.")
        clock.set_ros_time_override(self._last_time_set)
        clock._set_ros_time_is_active(self.ros_time_is_active)
        self._associated_clocks[clock] = None

    def clock_callback(self, msg: rosgraph_msgs.msg.Clock) -> None:
        """Set all clocks to the simulator's time. Raises ValueError if it is negative."""
        if self._rclpy_timeout is not None:
            self._rclpy_end_timeout()
        time = Time.from_msg(msg.clock)
        # The initial time of clocks that are attached later.
        self._last_time_set = time
        for clock in self._associated_clocks:
            clock.set_ros_time_override(time)

    def _rclpy_subscribe(self) -> None:
        from rosgraph_msgs.msg import Clock as ClockMessage

        node = self._get_node()
        if node is None or self._clock_sub is not None:
            return
        # A separate group: time must go on while a callback of the node sleeps.
        group = MutuallyExclusiveCallbackGroup()
        with _as_default(group):
            self._clock_sub = node.create_subscription(
                ClockMessage,
                CLOCK_TOPIC,
                self.clock_callback,
                QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
            )
        self._clock_sub._rclpy_deserialize = _deserialize_valid
        self._rclpy_timeout = node._rclpy_create_timer(
            CLOCK_TIMEOUT,
            self._rclpy_warn,
            callback_group=group,
            clock=Clock(clock_type=ClockType.STEADY_TIME),
        )

    def _rclpy_unsubscribe(self) -> None:
        node = self._get_node()
        if node is not None and self._clock_sub is not None:
            node.destroy_subscription(self._clock_sub)
        self._clock_sub = None
        self._rclpy_end_timeout()

    def _rclpy_end_timeout(self) -> None:
        node = self._get_node()
        if node is not None and self._rclpy_timeout is not None:
            node._rclpy_destroy_timer(self._rclpy_timeout)
        self._rclpy_timeout = None

    def _rclpy_warn(self) -> None:
        """Warn that no time has come. A message may wait: perhaps the node has not spun until now."""
        self._rclpy_end_timeout()
        node = self._get_node()
        if node is None or self._clock_sub is None:
            return
        if (waiting := self._clock_sub._rclpy_take()) is not None:
            self._clock_sub._rclpy_execute(waiting)
            return
        node.get_logger().warning(
            f"{USE_SIM_TIME_NAME} is true, but {self._clock_sub.topic_name} was silent for {CLOCK_TIMEOUT:g}"
            f" s: start a simulator, or set {USE_SIM_TIME_NAME} to false"
        )

    def _rclpy_check(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == USE_SIM_TIME_NAME and parameter.type_ is not Parameter.Type.BOOL:
                reason = f"{USE_SIM_TIME_NAME} parameter set to something besides a bool"
                if node := self._get_node():
                    node.get_logger().error(reason)
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def _rclpy_follow(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == USE_SIM_TIME_NAME:
                self.ros_time_is_active = parameter.value

    def _get_node(self) -> Node | None:
        return None if self._node_weak_ref is None else self._node_weak_ref()


def _deserialize_valid(data: bytes) -> rosgraph_msgs.msg.Clock:
    """Message of `/clock`. Raises ValueError if it is malformed, or its time negative."""
    from rosgraph_msgs.msg import Clock

    message = Clock._deserialize(data)
    Time.from_msg(message.clock)
    return message
