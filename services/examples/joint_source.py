"""Publishes two joints of a real robot as the joints of the arm.

User story (ours): as a robot operator, I see my own robot on the page, and never an old angle as a new one.
It replaces the virtual joints: start the arm with `SCENARIO=none`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import reactivex as rx
from rclpy.qos import QoSProfile, ReliabilityPolicy
from reactivex import Observable
from sensor_msgs.msg import JointState

from interfaces import service, topics
from interfaces.service import Rejected, UserError
from interfaces.topics import CLOCK_TOLERANCE
from reactive_node import stamps

# Remap this name to that of the robot's driver.
ROBOT_JOINTS = topics.Topic(
    "robot/joint_states",
    JointState,
    QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT),  # meets every publisher
    "rad",
    ("driver of the robot",),
    ("joint_source",),
    "angles of its joints",
)
SILENCE = 1.0  # s without an angle, after which health tells so


def joint_angle(
    states: Observable[JointState], joint: str, age: Callable[[JointState], float], max_age: float
) -> Observable[float | Rejected]:
    """Emit the angles of a joint [rad], and a rejection for each state that is too old or out of order.

    :param age: returns the age of a state's stamp [s].
    :param max_age: an older state is rejected [s].
    """

    def step(last: tuple[int, float | Rejected], state: JointState) -> tuple[int, float | Rejected]:
        newest, late = last[0], age(state)
        stamp = stamps.by_header(state).nanoseconds
        if len(state.position) != len(state.name):
            return newest, Rejected(ROBOT_JOINTS, f"{joint}: not each joint has a position")
        if not -CLOCK_TOLERANCE <= late <= max_age:
            return newest, Rejected(ROBOT_JOINTS, f"{joint}: {late:.3f} s old")
        # Two states of such ages are further apart only if the clock was set back.
        if 0.0 <= (newest - stamp) / 1e9 <= max_age + CLOCK_TOLERANCE:
            return newest, Rejected(ROBOT_JOINTS, f"{joint}: not newer than the state before")
        return stamp, state.position[list(state.name).index(joint)]

    def watched(items: Observable[float | Rejected]) -> Observable[float | Rejected]:
        good = items.filter(lambda it: not isinstance(it, Rejected)).start_with(0.0)
        silences = good.switch_map(lambda _: rx.timer(SILENCE, SILENCE / 2))
        silent = silences.map(lambda _: Rejected(ROBOT_JOINTS, f"{joint}: no angle for {SILENCE:g} s"))
        return rx.merge(items, silent)

    ours = states.filter(lambda state: joint in state.name)
    first: tuple[int, float | Rejected] = (0, 0.0)
    return ours.scan(step, first).map(lambda last: last[1]).publish(watched)


@dataclass(frozen=True)
class Parameters:
    theta1: str = service.parameter("theta1", None, "", "name of the robot's joint that is `theta1`")
    theta2: str = service.parameter("theta2", None, "", "name of the robot's joint that is `theta2`")
    max_age: float = service.parameter(0.2, (0.01, 10.0), "s", "an older angle is dropped")


def wire(node: service.ServiceNode) -> None:
    given = node.declare(Parameters)
    source, own = (node.resolve_topic_name(topic.name) for topic in (ROBOT_JOINTS, topics.JOINT_STATES))
    if source == own:  # an old angle would come back with a new stamp
        raise UserError(f"{ROBOT_JOINTS.name}: {own} is what the arm publishes; start it in a namespace")
    states = node.observe(ROBOT_JOINTS).share()

    def age(state: JointState) -> float:
        return node.age(stamps.from_message(state.header.stamp))

    for topic, joint in ((topics.THETA1, given.theta1), (topics.THETA2, given.theta2)):
        node.publish(topic, joint_angle(states, joint, age, given.max_age))


if __name__ == "__main__":
    service.run("joint_source", wire)
