from __future__ import annotations

from typing import TYPE_CHECKING

from builtin_interfaces.msg import Time
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock

if TYPE_CHECKING:
    from reactive_node.testing import MakeNode, SpinUntil


class Simulation:
    """A node whose time is simulated, and the simulator's clock."""

    def __init__(self, make_node: MakeNode, spin_until: SpinUntil) -> None:
        self.spin_until = spin_until
        self.clock = make_node("simulator")
        self.publisher = self.clock.create_publisher(Clock, "/clock", 10)
        self.node = make_node("simulated", parameter_overrides=[Parameter("use_sim_time", value=True)])
        spin_until(lambda: self.publisher.get_subscription_count() > 0)

    def set(self, seconds: float) -> None:
        self.set_to(round(seconds * 1e9))

    def set_to(self, nanoseconds: int) -> None:
        sec, nanosec = divmod(nanoseconds, 10**9)
        self.publisher.publish(Clock(clock=Time(sec=sec, nanosec=nanosec)))
        self.spin_until(lambda: self.node.get_clock().now().nanoseconds == nanoseconds)
