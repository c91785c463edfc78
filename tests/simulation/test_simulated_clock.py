"""A whole arm that follows /clock, in virtual time: the simulation runs slow or fast, and starts late."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

from interfaces.topics import CONFIGURATION

OUTPUTS = ("rt/joint_states", "rt/effector/twist", "rt/effector/position")
SCENE = "theta1: {center: 0.8, amplitude: 0.5, period: 6.0}\n"
TICK = 0.005  # s between two messages of /clock


def player(rate: float, late: float) -> None:
    """Publish /clock, and listen to what is published only for listeners."""
    import rclpy
    from builtin_interfaces.msg import Time
    from geometry_msgs.msg import TwistStamped
    from rosgraph_msgs.msg import Clock
    from sensor_msgs.msg import JointState

    rclpy.init()
    node = rclpy.create_node("player")
    clock = node.create_publisher(Clock, "/clock", 10)
    node.create_subscription(JointState, "joint_states", lambda _: None, 10)
    node.create_subscription(TwistStamped, "effector/twist", lambda _: None, 10)
    begin = node.get_clock().now().nanoseconds

    def publish() -> None:
        passed = (node.get_clock().now().nanoseconds - begin) / 1e9 - late
        if passed >= 0.0:
            sec, nanosec = divmod(round(passed * rate * 1e9), 10**9)
            clock.publish(Clock(clock=Time(sec=1_700_000_000 + sec, nanosec=nanosec)))

    node.create_timer(TICK, publish)
    rclpy.spin(node)


@pytest.mark.simulation(seed=7)
@pytest.mark.parametrize(("rate", "late"), [(1.0, 0.0), (1.0, 10.0), (0.1, 0.0), (10.0, 0.0)])
def test_arm_publishes_at_the_rate_of_its_simulation(
    simulation: Any, tmp_path: Any, rate: float, late: float
) -> None:
    scenario = tmp_path / "moving.yaml"
    scenario.write_text(SCENE)
    counts: Counter[str] = Counter()
    simulation.tap(lambda writer, sample: counts.update([writer.topic]))
    simulation.start(lambda: player(rate, late), name="player")
    simulated = ["--ros-args", "-p", "use_sim_time:=true"]
    for name in ("kinematics", "twist", "robot_state"):
        simulation.start(f"services.{name}", *simulated, name=name)
    for source in CONFIGURATION:
        scene = ["-p", f"scenario:={scenario}"]
        simulation.start("services.config_publisher", source, *simulated, *scene, name=f"config_{source}")
    simulation.run(late + 3.0)
    counts.clear()
    simulation.run(5.0)

    assert not simulation.ends
    seconds = 5.0 * rate
    for topic in OUTPUTS:
        assert 5.0 * seconds < counts[topic] < 55.0 * seconds, (topic, counts[topic])
