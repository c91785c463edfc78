"""Faults that a seed draws, and the search for the smallest part of them that matters."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
import rclpy
from mcap_files import McapFile
from std_msgs.msg import Int64
from std_srvs.srv import Trigger

from rclpy_simulation import Delay, Fault, Simulation
from rclpy_simulation.faults import KINDS, LOSS, minimal
from rclpy_simulation.timeline import Timeline


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


def test_a_drawn_cut_names_its_hosts_in_any_order(simulation: Simulation) -> None:
    simulation.start(talker, host="robot")
    simulation.start(talker, host="desk", name="second")
    simulation.inflict({"cut robot desk": 10.0})
    simulation.run(60.0)
    assert {fault.target for fault in simulation.faults} == {"desk robot"}


@pytest.mark.parametrize(
    ("what", "reason"),
    [
        ("explode", "no fault is called 'explode'"),
        ("delay numbers", "begins with /"),
        ("cut robot", "between two hosts"),
    ],
)
def test_a_fault_that_can_hit_nothing_is_refused(simulation: Simulation, what: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        simulation.inflict({what: 1.0})
    kind, _, target = what.partition(" ")
    with pytest.raises(ValueError, match=reason):
        simulation.inflict([Fault(1.0, kind, target, 1.0)])


def test_faults_for_a_program_that_never_was_are_an_error_at_the_end() -> None:
    def run(rates: dict[str, float]) -> None:
        with Simulation() as simulation:
            simulation.inflict(rates)
            simulation.start(talker)
            simulation.run(1.0)

    run({"kill talker": 1.0})
    with pytest.raises(ValueError, match=r"no program was called taker, .* they were called talker"):
        run({"kill taker": 1.0})


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


def test_a_killed_program_starts_again_as_it_was_started(simulation: Simulation) -> None:
    simulation.start(print, "word", delay=Delay(3.0, 3.0), host="robot")
    simulation.inflict([Fault(1.0, "kill", "print", 1.0)])
    simulation.run(4.9)
    assert [process.host.name for process in simulation.processes] == ["robot"]
    simulation.run(0.2)
    assert [end.exit_code for end in simulation.ends] == [-9, 0]


def serve() -> None:
    rclpy.init()
    node = rclpy.create_node("server")
    node.create_service(Trigger, "work", lambda _, response: response)
    rclpy.spin(node)


def ask_and_chat() -> None:
    rclpy.init()
    node = rclpy.create_node("client")
    client = node.create_client(Trigger, "work")
    client.wait_for_service()
    rclpy.spin_until_future_complete(node, client.call_async(Trigger.Request()))
    node.create_timer(0.1, lambda: print("still", node.get_clock().now().seconds_nanoseconds()[0]))
    rclpy.spin(node)


def test_a_timeline_has_faults_calls_and_the_last_words_of_a_program_that_prints_much() -> None:
    with Simulation(epoch=0) as simulation:
        timeline = Timeline(simulation)
        simulation.start(serve)
        simulation.start(ask_and_chat)
        simulation.inflict([Fault(20.0, "stop", "serve", 1.0)])
        simulation.run(40.0)
    text = re.sub(r" +", " ", re.sub(r"\d+\.\d{3}", "T", timeline.text))
    assert text.splitlines() == [
        " T serve starts: pid 1000",
        " T ask_and_chat starts: pid 1001",
        " T ask_and_chat calls /work",
        " T serve answers /work",
        " T – T ask_and_chat prints × 194: still 19",
        " T stop serve for 1.0 s",
        " T – T ask_and_chat prints × 200: still 39",
    ]


@pytest.mark.parametrize("needed", [[], [0], [3], [2, 7], [0, 5, 9], [*range(10)]])
def test_the_smallest_part_that_fails_is_found(needed: list[int]) -> None:
    tried: list[Sequence[int]] = []

    def fails(part: Sequence[int]) -> bool:
        tried.append(part)
        return {*needed} <= {*part}

    assert [*minimal(range(10), fails)] == needed
    assert len(tried) < 100


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
