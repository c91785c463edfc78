"""The network model against Cyclone DDS: the same programs, in real processes and simulated."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import Any

import pytest
from tests.simulation_kit.tests import programs

from rclpy_simulation import Simulation

Record = dict[str, Any]


pytestmark = pytest.mark.timed  # lifespans and leases of real processes


@pytest.fixture(scope="module")
def real(module_domain_id: int) -> tuple[Record, Record]:
    environment = os.environ | {"ROS_DOMAIN_ID": str(module_domain_id), "RUNTIME": "cyclonedds"}

    def start(name: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", programs.__name__, name]
        return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)

    with start("talker") as talker:
        assert talker.stdout is not None
        assert talker.stdout.readline() == "early\n"
        with start("listener") as listener:
            notes = talker.communicate(timeout=40)[0], listener.communicate(timeout=40)[0]
    return json.loads(notes[0]), json.loads(notes[1])


@pytest.fixture(scope="module")
def simulated() -> tuple[Record, Record]:
    with Simulation(seed=1) as simulation:
        talker = simulation.start(programs.talker)
        simulation.run_until(lambda: "early" in talker.output.text)
        listener = simulation.start(programs.listener)
        simulation.run_until(lambda: talker.ended and listener.ended)
    notes = [process.output.text.splitlines()[-1] for process in (talker, listener)]
    return json.loads(notes[0]), json.loads(notes[1])


@pytest.fixture(params=["real", "simulated"])
def notes(request: pytest.FixtureRequest) -> tuple[Record, Record]:
    found: tuple[Record, Record] = request.getfixturevalue(request.param)
    return found


@pytest.fixture
def talker(notes: tuple[Record, Record]) -> Record:
    return notes[0]


@pytest.fixture
def listener(notes: tuple[Record, Record]) -> Record:
    return notes[1]


@pytest.mark.parametrize(
    ("topic", "numbers"),
    [
        ("history", [3, 4, 5]),  # a late joiner gets what is transient local
        ("history_best_effort", []),
        ("history_expired", []),
        ("volatile", [6]),  # what was sent before the match is lost
        ("order", list(range(100))),
        ("overflow", [4, 5]),  # a full reader keeps the last samples
        ("short_life", []),  # it expires in the queue of a busy reader
    ],
)
def test_a_reader_gets_what_its_policies_allow(listener: Record, topic: str, numbers: list[int]) -> None:
    assert listener["received"][topic] == numbers


def test_samples_that_are_overwritten_or_expired_are_not_reported_as_lost(listener: Record) -> None:
    assert listener["lost"] == 0


def test_a_reader_counts_missed_deadlines_from_the_first_sample(listener: Record) -> None:
    assert listener["deadlines_before_1"] == 0
    assert listener["deadlines_before_2"] >= 3


def test_a_writer_counts_missed_deadlines_too(talker: Record) -> None:
    assert talker["deadlines"] >= 3


def test_a_silent_manual_writer_loses_its_liveliness(talker: Record) -> None:
    assert talker["lost_before_assertion"] == 1


def test_a_sample_revives_a_writer_and_an_assertion_does_not(listener: Record) -> None:
    alive, lost, gone = [1, 0], [0, 1], [0, 0]
    states = [state for state in listener["alive"] if state != gone]
    assert states[-3:] == [lost, alive, lost]
    assert states[:-3] in ([alive], [])  # the end of its first life may be known before its beginning


@pytest.mark.parametrize(
    ("topic", "policy"),
    [
        ("too_unreliable", "RELIABILITY"),
        ("too_volatile", "DURABILITY"),
        ("too_slow", "DEADLINE"),
        ("too_automatic", "LIVELINESS"),
        ("too_long_lease", "LIVELINESS"),
    ],
)
def test_incompatible_qos_is_reported_on_both_sides(
    talker: Record, listener: Record, topic: str, policy: str
) -> None:
    assert talker["incompatible"][topic] == listener["incompatible"][topic] == policy
    assert listener["received"][topic] == []


def test_an_end_in_order_unmatches_at_once(listener: Record) -> None:
    assert listener["matched"] == [1, 0]
