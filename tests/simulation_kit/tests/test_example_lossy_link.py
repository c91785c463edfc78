"""Worked example: a talker and a listener on a lossy link."""

from __future__ import annotations

import pytest
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Int64

from rclpy_simulation import Delay, Network, Simulation

BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
RELIABLE = QoSProfile(depth=10)


class Talker(Node):
    def __init__(self, profile: QoSProfile) -> None:
        super().__init__("talker")
        self.numbers = self.create_publisher(Int64, "numbers", profile)
        self.count = 0
        self.create_timer(0.1, self.on_timer)

    def on_timer(self) -> None:
        self.count += 1
        self.numbers.publish(Int64(data=self.count))


class Listener(Node):
    def __init__(self, profile: QoSProfile, heard: list[int]) -> None:
        super().__init__("listener")
        self.create_subscription(Int64, "numbers", lambda message: heard.append(message.data), profile)


def talk(profile: QoSProfile) -> None:
    rclpy.init()
    rclpy.spin(Talker(profile))


def listen(profile: QoSProfile, heard: list[int]) -> None:
    rclpy.init()
    rclpy.spin(Listener(profile, heard))


def start(simulation: Simulation, profile: QoSProfile) -> list[int]:
    """Start both on different hosts; return what the listener will hear."""
    heard: list[int] = []
    simulation.start(lambda: listen(profile, heard), name="listener", host="desk")
    simulation.run(1.0)
    simulation.start(lambda: talk(profile), name="talker", host="robot")
    simulation.run_until(lambda: heard)
    return heard


@pytest.mark.simulation(seed=7)
def test_a_best_effort_listener_misses_numbers(simulation: Simulation) -> None:
    heard = start(simulation, BEST_EFFORT)
    simulation.network.loss = 0.2
    simulation.run(600.0)
    share = len(heard) / (heard[-1] - heard[0] + 1)
    assert share == pytest.approx(0.8, abs=0.03)


@pytest.mark.simulation(seed=7, network=Network(loss=0.2, retransmission=Delay(0.02, 0.1)))
def test_a_reliable_listener_gets_every_number(simulation: Simulation) -> None:
    heard = start(simulation, RELIABLE)
    simulation.run(600.0)
    assert heard == list(range(heard[0], heard[-1] + 1))
    assert len(heard) > 5990


@pytest.mark.simulation(seed=7)
def test_a_listener_hears_the_talker_again_after_a_partition(simulation: Simulation) -> None:
    heard = start(simulation, RELIABLE)
    simulation.cut("robot", "desk")
    simulation.run(60.0)  # longer than the lease: they forget each other
    before = heard[-1]
    simulation.heal("robot", "desk")
    simulation.run_until(lambda: heard[-1] > before, seconds=simulation.network.announcement + 1.0)
    assert heard[-1] - before > 500  # volatile: what was said meanwhile is lost
