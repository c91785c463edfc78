"""Services whose ROS time is simulated by messages of /clock, which start late, pause and jump."""

from __future__ import annotations

import time
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from reactivex.subject import Subject
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Header, String

from interfaces.service import ServiceNode
from interfaces.topics import (
    CONFIGURATION,
    EFFECTOR_POSITION,
    EFFECTOR_SPEED,
    EFFECTOR_TWIST,
    ENGINES,
    ENGINES_STATE,
    JOINT_STATES,
    OFF,
    ON,
    OPERATOR_HEARTBEAT,
    THETA1,
    TURN_ON,
    Topic,
)
from reactive_node.ros_time import in_ros_time
from reactive_node.signals import Answer, hold
from reactive_node.stamps import Timestamp, by_header
from reactive_node.testing import MakeNode, SpinFor, SpinUntil
from services import engine_controller, kinematics, operator_watchdog, robot_state, twist, velocity
from services.examples import joint_source
from services.examples.joint_source import ROBOT_JOINTS

DAY = 86_400.0  # s
YEARS = 1_700_000_000.0  # s, a record of a robot
TURN = 0.5  # rad/s
OUTPUTS = (JOINT_STATES, EFFECTOR_TWIST, EFFECTOR_POSITION, EFFECTOR_SPEED)


def seconds(stamp: Time) -> float:
    return float(stamp.sec + stamp.nanosec / 1e9)


class Simulator:
    """Moves theta1 with simulated time, and hears what the services publish."""

    def __init__(self, make_node: MakeNode, spin_until: SpinUntil, **services: Any) -> None:
        self.make_node, self.spin_until = make_node, spin_until
        self.peer: Node = make_node("simulator", kind=Node)
        self.now = 0.0
        self.clock = self.peer.create_publisher(Clock, "/clock", 10)
        self.heard: dict[str, list[Any]] = {}
        self.services: list[ServiceNode] = []
        for name, wire in services.items():
            simulated = [Parameter("use_sim_time", value=True)]
            self.services.append(make_node(name, kind=ServiceNode, parameter_overrides=simulated))
            wire(self.services[-1])
        spin_until(lambda: self.clock.get_subscription_count() == len(services))

    def hear(self, *topics: Topic) -> None:
        for topic in topics:
            heard = self.heard[topic.name] = []
            self.peer.create_subscription(topic.type, topic.name, heard.append, topic.qos)
            self.spin_until(lambda name=topic.name: self.peer.count_publishers(name))

    def set(self, now: float) -> None:
        """Set simulated time, and wait until all know it."""
        self.now = now
        nanoseconds = round(now * 1e9)
        sec, nanosec = divmod(nanoseconds, 10**9)
        again = 0.0

        def is_known() -> bool:
            nonlocal again
            if time.monotonic() >= again:  # readers of /clock are best effort
                again = time.monotonic() + 0.1
                self.clock.publish(Clock(clock=Time(sec=sec, nanosec=nanosec)))
            return all(each.get_clock().now().nanoseconds == nanoseconds for each in self.services)

        self.spin_until(is_known)


class Arm(Simulator):
    def __init__(self, make_node: MakeNode, spin_until: SpinUntil) -> None:
        wires = {module.__name__.split(".")[-1]: module.wire for module in (kinematics, twist, robot_state)}
        super().__init__(make_node, spin_until, **wires, velocity=velocity.wire)
        self.angle = 0.0
        self.joints = {
            name: self.peer.create_publisher(topic.type, topic.name, topic.qos)
            for name, topic in CONFIGURATION.items()
        }
        self.hear(*OUTPUTS)
        for name in self.joints:
            self.joints[name].publish(Float64(data=1.0))
        spin_until(lambda: self.heard[EFFECTOR_POSITION.name])

    def play(self, passed: float, step: float = 0.01) -> None:
        for _ in range(round(passed / step)):
            self.set(self.now + step)
            self.angle += TURN * step
            positions, before = self.heard[EFFECTOR_POSITION.name], len(self.heard[EFFECTOR_POSITION.name])
            self.joints[THETA1.name].publish(Float64(data=self.angle))
            self.spin_until(lambda: len(positions) > before)  # noqa: B023

    def works(self) -> None:
        """Let a second pass, and look at what comes."""
        begin = self.now
        for heard in self.heard.values():
            heard.clear()
        self.play(1.0)

        def found(topic: Topic, least: int) -> list[Any]:
            heard = self.heard[topic.name]
            self.spin_until(lambda: heard and seconds(heard[-1].header.stamp) > self.now - 0.3)
            assert len(heard) >= least
            assert len(heard) < 200, f"{len(heard)} messages of {topic.name} in a second"
            stamps = [seconds(each.header.stamp) for each in heard]
            assert stamps == sorted(stamps)
            assert begin - 1.0 <= stamps[0] <= stamps[-1] <= self.now + 1e-6
            return heard

        states: list[JointState] = found(JOINT_STATES, 10)
        assert states[-1].position[0] == pytest.approx(self.angle, abs=0.2)
        turns: list[TwistStamped] = found(EFFECTOR_TWIST, 10)
        assert turns[-1].twist.angular.z == pytest.approx(TURN, abs=0.2)
        found(EFFECTOR_POSITION, 10)
        self.spin_until(lambda: self.heard[EFFECTOR_SPEED.name])


@pytest.fixture
def arm(make_node: MakeNode, spin_until: SpinUntil) -> Arm:
    return Arm(make_node, spin_until)


@pytest.mark.parametrize("begin", [0.0, 10.0, YEARS])
def test_arm_works_when_the_simulation_starts_late(arm: Arm, spin_for: SpinFor, begin: float) -> None:
    spin_for(0.5)
    assert arm.heard[JOINT_STATES.name] == arm.heard[EFFECTOR_TWIST.name] == []
    arm.set(begin)
    arm.play(1.0)
    arm.works()


def test_arm_stands_still_with_the_simulation(arm: Arm, spin_for: SpinFor) -> None:
    arm.set(YEARS)
    arm.play(1.0)
    spin_for(0.2)
    before = {name: len(heard) for name, heard in arm.heard.items()}
    spin_for(1.0)
    assert {name: len(heard) for name, heard in arm.heard.items()} == before
    arm.works()


@pytest.mark.parametrize("jump", [0.3, 2.0, 30.0, DAY, -0.3, -2.0, -DAY, -YEARS])
def test_arm_works_after_a_jump(arm: Arm, jump: float) -> None:
    arm.set(YEARS)
    arm.play(1.0)
    arm.set(max(0.0, arm.now + jump))
    arm.play(1.0)
    arm.works()


@pytest.mark.parametrize("step", [0.001, 0.05])
def test_arm_works_at_each_step_of_the_clock(arm: Arm, step: float) -> None:
    arm.set(YEARS)
    arm.play(1.0, step)
    arm.works()


def test_engines_follow_the_hand_in_simulated_time(make_node: MakeNode, spin_until: SpinUntil) -> None:
    wires = {module.__name__.split(".")[-1]: module.wire for module in (engine_controller, operator_watchdog)}
    arm = Simulator(make_node, spin_until, **wires)
    heartbeats, commands = (
        arm.peer.create_publisher(topic.type, topic.name, topic.qos)
        for topic in (OPERATOR_HEARTBEAT, ENGINES)
    )
    arm.hear(ENGINES_STATE)
    states = arm.heard[ENGINES_STATE.name]
    for begin in (YEARS, YEARS + 0.1):  # the watchdog listens from the begin of the scenario on
        arm.set(begin)
    spin_until(lambda: heartbeats.get_subscription_count() and commands.get_subscription_count())

    def pass_until(state: str, *messages: Any) -> None:
        """Send messages and let time pass, until the engines have a state."""

        def passes() -> bool:
            for publisher, message in messages:
                publisher.publish(message)
            arm.set(arm.now + 0.1)  # it may run ahead of the services' timers
            return String(data=state) in states[-1:]

        spin_until(passes)

    pass_until(ON, (heartbeats, Bool(data=True)), (commands, String(data=TURN_ON)))
    pass_until(OFF)


# The robot's own states


def test_states_of_a_simulated_robot_count_by_simulated_time(
    make_node: MakeNode, spin_until: SpinUntil
) -> None:
    robot = Simulator(make_node, spin_until, joint_source=joint_source.wire)
    robot.hear(THETA1)
    states = robot.peer.create_publisher(JointState, ROBOT_JOINTS.name, 10)
    spin_until(states.get_subscription_count)

    def play(ahead: float) -> None:
        robot.set(robot.now + 0.3)
        state = JointState(name=["theta1", "theta2"], position=[robot.now, 0.0])
        sec, nanosec = divmod(round((robot.now + ahead) * 1e9), 10**9)
        state.header.stamp = Time(sec=sec, nanosec=nanosec)
        states.publish(state)

    angles = robot.heard[THETA1.name]
    for begin in (100.0, 100.0 + DAY, 50.0):  # a jump in each direction
        robot.set(begin)
        for ahead in (0.0, joint_source.Parameters().max_age):  # of the last /clock
            play(ahead)
            spin_until(lambda: angles and angles[-1].data == robot.now)
    for wrong in (-3.0, 3.0):
        play(wrong)
        bad = robot.now
        play(0.0)
        spin_until(lambda: angles[-1].data == robot.now)
        assert bad not in [each.data for each in angles], "an angle of another time"


# Signals


class Asked:
    """A signal of a node whose time is simulated."""

    def __init__(self, simulator: Simulator, samples: Any) -> None:
        (node,) = simulator.services
        self.found: list[Answer[Any]] = []
        hold(samples, lateness=0.1).sample(0.05).subscribe(self.found.append, scheduler=node.scheduler)


def nothing(node: ServiceNode) -> None:
    """Wire nothing."""


def test_source_times_are_turned_into_simulated_times(make_node: MakeNode, spin_until: SpinUntil) -> None:
    simulator = Simulator(make_node, spin_until, listener=nothing)
    (node,) = simulator.services
    messages = node.create_observable(Float64, "value", timestamped=True).pipe(in_ros_time(node.scheduler))
    asked = Asked(simulator, messages)
    publisher = simulator.peer.create_publisher(Float64, "value", 10)
    spin_until(publisher.get_subscription_count)
    simulator.set(YEARS)
    for number in range(3):
        publisher.publish(Float64(data=float(number)))
    for tick in range(1, 100):
        simulator.set(YEARS + tick / 100)

    assert asked.found[-1].value.data == 2.0
    assert asked.found[-1].is_certain


def test_messages_without_a_stamp_are_no_samples(make_node: MakeNode, spin_until: SpinUntil) -> None:
    simulator = Simulator(make_node, spin_until, listener=nothing)
    headers: Subject[Header] = Subject()
    unstamped = headers.map(lambda it: by_header(JointState(header=it)))
    asked = Asked(simulator, unstamped)
    for tick in range(100):
        simulator.set(tick / 100)
        headers.on_next(Header())

    assert asked.found
    assert not [each for each in asked.found if each.is_certain]


def test_real_time_is_not_converted(make_node: MakeNode) -> None:
    samples: Subject[Timestamp[str]] = Subject()
    found: list[Timestamp[str]] = []
    samples.pipe(in_ros_time(make_node().scheduler)).subscribe(found.append)
    sample = by_header(JointState(header=Header(stamp=Time(sec=7))))
    samples.on_next(sample)
    assert found == [sample]
