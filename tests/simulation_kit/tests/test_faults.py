"""Faults that a seed draws, and the search for the smallest part of them that matters."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import rclpy
from mcap_files import McapFile
from std_msgs.msg import Int64

from rclpy_simulation import Fault, Simulation
from rclpy_simulation.faults import KINDS, LOSS, minimal


def talker() -> None:
    rclpy.init()
    node = rclpy.create_node("talker")
    publisher = node.create_publisher(Int64, "numbers", 10)
    node.create_timer(0.1, lambda: publisher.publish(Int64(data=1)))
    rclpy.spin(node)


def drawn(seed: int) -> list[Fault]:
    with Simulation(seed) as simulation:
        simulation.start(talker, host="one")
        simulation.start(talker, host="other", name="second")
        simulation.inflict(dict.fromkeys(KINDS, 6.0))
        simulation.run(600.0)
        return simulation.faults


def test_a_seed_draws_the_same_faults_at_the_rates_that_are_asked_for() -> None:
    faults = drawn(3)
    assert faults == drawn(3) != drawn(4)
    for kind in KINDS:
        assert 30 <= sum(fault.kind == kind for fault in faults) <= 90
    targets = {fault.kind: {each.target for each in faults if each.kind == fault.kind} for fault in faults}
    programs = {"talker", "second"}
    expected = {"kill": programs, "stop": programs, "loss": {""}, "delay": {"/numbers"}, "cut": {"one other"}}
    assert targets == expected
    assert all(0.1 <= fault.length <= 5.0 for fault in faults)


def test_only_the_targets_that_are_named_are_hit(simulation: Simulation) -> None:
    simulation.start(talker)
    simulation.start(talker, name="second")
    simulation.inflict({"kill second": 10.0})
    simulation.run(120.0)
    assert {fault.target for fault in simulation.faults} == {"second"}
    with pytest.raises(ValueError, match="no fault is called 'explode'"):
        simulation.inflict({"explode": 1.0})


def test_faults_do_what_they_are_called(simulation: Simulation) -> None:
    sent: list[float] = []
    simulation.tap(lambda writer, _: sent.append(simulation.now) if writer.topic == "rt/numbers" else None)
    first = simulation.start(talker)
    faults = [
        Fault(2.0, "kill", "talker", 1.0),
        Fault(6.0, "stop", "talker", 1.0),
        Fault(9.0, "loss", "", 1.0),
    ]
    simulation.inflict([*faults, Fault(9.5, "loss", "", 1.0), Fault(9.6, "kill", "nobody", 1.0)])
    simulation.run(1.9)
    assert not first.ended
    simulation.run(0.2)
    assert first.ended
    simulation.run(7.0)
    assert simulation.network.loss == LOSS
    simulation.run(1.2)
    assert simulation.network.loss == LOSS
    simulation.run(1.0)
    assert simulation.network.loss == 0.0
    assert not [time for time in sent if 2.0 < time < 3.0 or 6.01 < time < 7.0]
    assert [time for time in sent if 4.0 < time < 5.0]
    assert [fault.target for fault in simulation.faults] == ["talker", "talker", "", ""]


def test_the_smallest_part_that_fails_is_found() -> None:
    assert minimal(list(range(100)), lambda part: {3, 77} <= set(part)) == [3, 77]
    assert minimal([1, 2, 3], lambda part: True) == []


TEST = """
import pytest
import rclpy
from std_msgs.msg import Int64

RUNS = []


def count():
    rclpy.init()
    node = rclpy.create_node("counter")
    publisher = node.create_publisher(Int64, "count", 10)
    numbers = iter(range(1000))
    node.create_timer(1.0, lambda: publisher.publish(Int64(data=next(numbers))))
    rclpy.spin(node)


@pytest.fixture
def fresh(tmp_path):
    assert not list(tmp_path.iterdir())
    (tmp_path / "used").touch()
    RUNS.append(1)


@pytest.mark.simulation(seeds=range(50), faults={"kill": 1, "stop": 2, "loss": 2})
def test_a_counter_counts(simulation, fresh):
    sent = []
    simulation.tap(lambda writer, _: sent.append(1) if writer.topic == "rt/count" else None)
    simulation.start(count)
    simulation.run(20.0)
    assert all(fault.kind != "kill" for fault in simulation.faults)


@pytest.mark.simulation(seeds=range(5))
def test_all_seeds_pass(simulation, fresh):
    before = len(RUNS)
    simulation.start(count)
    simulation.run(3.0)


def test_each_seed_had_a_run():
    assert len(RUNS) >= 5
"""


def output_of(test: str, tmp_path: Path) -> str:
    """Return what pytest prints of a file of tests."""
    (tmp_path / "test_count.py").write_text(test)
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    options = ["--disable-plugin-autoload", "-p", "rclpy_simulation.testing", "--strict-markers", "-q"]
    command = [sys.executable, "-m", "pytest", *options]
    return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=os.environ).stdout


OWN_FIXTURE = """
import pytest
from rclpy_simulation import Simulation


@pytest.fixture
def simulation():
    with Simulation() as simulation:
        yield simulation


def test_that_fails(simulation):
    assert simulation.now > 1.0, "too early"
"""


def test_a_failure_with_a_fixture_of_ones_own_is_reported(tmp_path: Path) -> None:
    text = output_of(OWN_FIXTURE, tmp_path)
    assert "AssertionError: too early" in text
    assert "1 failed" in text


def test_a_failure_names_the_seed_the_fewest_faults_and_a_timeline(tmp_path: Path) -> None:
    text = output_of(TEST, tmp_path)
    assert "1 failed, 2 passed" in text, text
    assert re.search(r"Seed \d+ fails, number \d+ of 50. 1 of its \d+ faults is enough:", text)
    (fault,) = re.findall(r"^    (Fault\(at=.*\)),$", text, re.MULTILINE)
    assert "kind='kill', target='count'" in fault
    assert re.search(r"\d\.\d{3}            kill count for \d", text)
    assert re.search(r"count sends /count × \d", text)
    (record,) = re.findall(r"^Its messages: (.*)$", text, re.MULTILINE)
    with McapFile(Path(record)) as file:
        assert {channel.topic for channel, _ in file.messages()} == {"/count"}
