"""The operator watchdog, with its wiring, in virtual time: it reads heartbeats by the clock."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from rclpy_simulation import Network, Simulation
from std_msgs.msg import Bool

from interfaces import topics
from tests.promises.observations import values
from tests.simulation.machine import simulated_services

RATE = 20.0  # Hz of a switch
HELD = 2.0  # s between two silences


@pytest.fixture
def simulation() -> Iterator[Simulation]:
    with simulated_services("watchdog", Network()) as simulation:
        yield simulation


def hold(*silences: float) -> None:
    """Hold a switch for HELD seconds before each of these silences [s]."""
    rclpy.init()
    node = rclpy.create_node("switch")
    topic = topics.OPERATOR_HEARTBEAT
    publisher = node.create_publisher(topic.type, topic.name, topic.qos)
    for silence in silences:
        for _ in range(round(HELD * RATE)):
            time.sleep(1 / RATE)
            publisher.publish(Bool(data=True))
        time.sleep(silence - 1 / RATE)


@pytest.mark.parametrize("sampling", [0.5, 0.07])
def test_silence_is_no_strike_up_to_the_error_of_a_sample(simulation: Simulation, sampling: float) -> None:
    concluded: list[str] = []

    def note(writer: Any, sample: Any) -> None:
        if writer.topic == f"rt/{topics.OPERATOR_ACTIVITY.name}":
            concluded.extend(values(topics.OPERATOR_ACTIVITY, sample.data, "/"))

    simulation.tap(note)
    silences = [3.0 - sampling - 0.01] * 80
    switch = simulation.start(lambda: hold(*silences), name="switch")
    simulation.start("services.operator_watchdog", "--ros-args", "-p", f"sampling:={sampling}")
    simulation.run_until(lambda: switch.ended, 1000.0)
    assert len(concluded) > 3 * len(silences)
    assert set(concluded) == {topics.ALIVE}
