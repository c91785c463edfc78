"""Publishes two joints of a real robot as the joints of the arm.

User story (ours): as a robot operator, I see my own robot on the page, and never an old angle as a new one.
It replaces the virtual joints: start the arm with `SCENARIO=none`.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial

import reactivex as rx
from rclpy.qos import QoSProfile, ReliabilityPolicy
from reactivex import Observable
from sensor_msgs.msg import JointState

from interfaces import robot_joints, service, topics
from interfaces.service import Rejected, UserError
from interfaces.service.reading import not_fresh
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


def joint_angle(
    states: Observable[JointState],
    joint: str,
    age: Callable[[JointState], float],
    max_age: float,
    publishers: Callable[[], Collection[str]] = tuple,
) -> Observable[float | Rejected]:
    """Emit the angles of a joint [rad], and a rejection for each state that is too old or out of order.

    So it does when no angle comes, and when two nodes publish the joint.

    :param age: returns the age of a state's stamp [s].
    :param max_age: an older state is rejected [s].
    :param publishers: returns the nodes that publish states.
    """

    def rejected(reason: str) -> Rejected:
        return Rejected(ROBOT_JOINTS, f"{joint}: {reason}")

    def step(last: tuple[int, float | Rejected], state: JointState) -> tuple[int, float | Rejected]:
        newest, stamp = last[0], stamps.by_header(state).nanoseconds
        if stamp == stamps.UNSTAMPED:
            return newest, rejected("no stamp")
        if len(state.position) != len(state.name):
            return newest, rejected(f"{len(state.name)} names and {len(state.position)} positions")
        if problem := not_fresh(age(state), max_age, CLOCK_TOLERANCE):
            return newest, rejected(problem)
        # Two states of such ages are further apart only if the clock was set back.
        if 0.0 <= (newest - stamp) / 1e9 <= max_age + CLOCK_TOLERANCE:
            return newest, rejected("not newer than the state before")
        return stamp, state.position[list(state.name).index(joint)]

    def watched(items: Observable[float | Rejected]) -> Observable[float | Rejected]:
        good = items.filter(lambda it: not isinstance(it, Rejected))
        return rx.merge(items, robot_joints.complaints(good, states, joint, publishers).map(rejected))

    # A state without any position is one of velocities or efforts only.
    ours = states.filter(lambda state: joint in state.name and len(state.position) > 0)
    first: tuple[int, float | Rejected] = (0, 0.0)
    return ours.scan(step, first).map(lambda last: last[1]).publish(watched)


@dataclass(frozen=True)
class Parameters:
    theta1: str = service.parameter("theta1", None, "", "name of the robot's joint that is `theta1`")
    theta2: str = service.parameter("theta2", None, "", "name of the robot's joint that is `theta2`")
    max_age: float = service.parameter(0.2, (0.01, 10.0), "s", "an older angle is dropped")


def wire(node: service.ServiceNode) -> None:
    parameters = node.declare(Parameters)
    source, own = (node.resolve_topic_name(topic.name) for topic in (ROBOT_JOINTS, topics.JOINT_STATES))
    if source == own:  # an old angle would come back with a new stamp
        raise UserError(f"{ROBOT_JOINTS.name}: {own} is what the arm publishes; start it in a namespace")
    states = node.observe(ROBOT_JOINTS).share()

    def age(state: JointState) -> float:
        late = node.stamp_age(stamps.by_header(state).nanoseconds)
        # A simulator stamps by its own clock, which /clock shows only now and then.
        return max(late, 0.0) if node.scheduler.is_simulated and late >= -parameters.max_age else late

    publishers = partial(node.peers.publishers, ROBOT_JOINTS)
    for topic, joint in ((topics.THETA1, parameters.theta1), (topics.THETA2, parameters.theta2)):
        node.publish(topic, joint_angle(states, joint, age, parameters.max_age, publishers))


if __name__ == "__main__":
    service.run("joint_source", wire)
