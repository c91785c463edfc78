"""A replay gives the velocities of a run again, byte for byte, although messages were late."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import deserialize_message, serialize_message
from rclpy_simulation import Delay, Network
from rclpy_simulation.host import SECOND
from std_msgs.msg import Float64

from interfaces.service.health import reported_refusals
from interfaces.topics import CONFIGURATION, DIAGNOSTICS, EFFECTOR_TWIST, JOINT_STATES, L1
from tests.replay import chains
from tests.replay.playback import replay
from tests.replay.record import Message, Record
from tests.simulation.arm import ROBOT
from tests.simulation.machine import simulated_services
from tests.simulation.viewer import view

START = 3 * SECOND  # in which processes discover each other [ns]
SERVICES = {"twist": EFFECTOR_TWIST, "robot_state": JOINT_STATES}
SCENARIO = """
theta1: {center: 0.8, amplitude: 0.8, period: 20.0}
theta2: {center: 0.8, amplitude: 0.5, period: 10.0, rest: 2.0}
"""


@pytest.fixture(scope="module", params=["late", "later"])
def record(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Record:
    """A minute of movements; one message in fifty is later than the signals wait, some by half a second."""
    scenario = tmp_path_factory.mktemp("replay") / "scenario.yaml"
    scenario.write_text(SCENARIO)
    messages: defaultdict[str, list[Message]] = defaultdict(list)
    network = Network(latency=Delay(0.005, 0.08), discovery=Delay(0.01, 0.01), matching=Delay(0.002, 0.002))
    with simulated_services(request.param, network) as simulation:
        begin = simulation.host(ROBOT).time_of_day(0)
        for name in CONFIGURATION:
            arguments = [name, "--ros-args", "-p", f"scenario:={scenario}"]
            simulation.start("services.config_publisher", *arguments, host=ROBOT, name=f"config_{name}")
        for service in SERVICES:
            simulation.start(f"services.{service}", host=ROBOT, name=service)
        simulation.start(view, name="viewer", host=ROBOT)

        def note(writer: Any, sample: Any) -> None:
            messages[writer.topic.removeprefix("rt")].append(Message(sample.source_timestamp, sample.data))

        simulation.tap(note)
        simulation.run(60.0)
    begin, end = messages["/l1"][0].sent, messages["/diagnostics"][-1].sent
    return Record(begin, end, begin, dict(messages), extents={"/": (begin, end)})


@pytest.mark.parametrize("service", SERVICES)
def test_replay_gives_the_same_bytes(record: Record, service: str) -> None:
    topic = SERVICES[service]
    live = record.of(topic, "/")
    refused = [
        refusal
        for message in record.of(DIAGNOSTICS, "/")
        for status in deserialize_message(message.data, DiagnosticArray).status
        if status.name == f"/{service}"
        for name in CONFIGURATION
        for refusal in reported_refusals(status, name)
    ]
    assert len(refused) > 10

    replayed = replay(record, "/", (service,)).messages[topic.name]

    def content(messages: list[Message]) -> list[bytes]:
        return [each.data for each in messages if record.begin + START < each.sent < record.end - SECOND]

    assert len(content(live)) > 1000
    assert content(replayed) == content(live)


def test_refused_samples_are_those_of_the_health_reports() -> None:
    def sample(at: int) -> Message:
        return Message(at, serialize_message(Float64(data=float(at))))

    report = DiagnosticStatus(
        name="/twist",
        values=[
            KeyValue(key=key, value=value)
            for key, value in (
                ("pid", "1"),
                ("uptime", "1.0"),
                ("refused l1", "[[2, null], [3, 7], [5, null]]"),
            )
        ],
    )
    health = Message(9, serialize_message(DiagnosticArray(status=[report])))
    lengths = [sample(1), sample(2), sample(3), sample(4), sample(5), sample(5)._replace(data=b"second")]
    record = Record(0, 10, 0, {"/l1": lengths, "/diagnostics": [health]})

    (topic, heard), *_ = chains.inputs(record, "/", ("twist",))

    assert topic is L1
    assert [each.sent for each in heard] == [1, 4, 5, 7]
    assert [each.data for each in heard] == [lengths[k].data for k in (0, 3, 4, 2)]
    (_, others), *_ = chains.inputs(record, "/", ("kinematics",))
    assert others == lengths
