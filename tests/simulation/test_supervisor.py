"""The simulated supervisor treats its programs as supervisord does with this manifest."""

from __future__ import annotations

import itertools
import signal
from collections.abc import Callable, Iterator

import pytest
from rclpy_simulation import Delay, Process, Simulation

from tests.simulation.supervisor import Supervisor


class Programs:
    """A supervisor with one program, `sentinel`, and the start times of its processes."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.main: Callable[[], None] = sleep
        self.starts: list[float] = []
        self.supervisor = Supervisor(simulation, ["sentinel"], self.spawn)

    def spawn(self, name: str, parent: int) -> Process:
        self.starts.append(self.simulation.now)
        return self.simulation.start(lambda: self.main(), name=name, parent=parent, delay=Delay(0.1, 0.1))

    @property
    def process(self) -> Process:
        process = self.supervisor.process("sentinel")
        assert process is not None
        return process

    @property
    def state(self) -> str:
        return self.supervisor.programs()[0].state


def sleep() -> None:
    import time

    while True:
        time.sleep(1.0)


def fail() -> None:
    raise RuntimeError("the program fails")


@pytest.fixture
def programs() -> Iterator[Programs]:
    with Simulation() as simulation:
        yield Programs(simulation)


def test_a_program_runs_after_a_second(programs: Programs) -> None:
    programs.simulation.run(0.99)
    assert programs.state == "STARTING"
    programs.simulation.run(0.02)
    assert programs.state == "RUNNING"


def test_a_running_program_starts_again_at_once(programs: Programs) -> None:
    programs.simulation.run(5.0)
    programs.process.kill()
    programs.simulation.run(0.01)
    assert programs.starts == [0.0, 5.0]
    assert programs.supervisor.programs()[0].exit == "killed by a signal"
    assert programs.supervisor.programs()[0].restarts == 1


def test_the_pause_after_an_early_end_grows_by_a_second(programs: Programs) -> None:
    programs.main = fail
    programs.simulation.run(11.0)
    pauses = [two - one - 0.1 for one, two in itertools.pairwise(programs.starts)]
    assert [int(pause) for pause in pauses] == [1, 2, 3, 4]
    assert all(pause % 1 <= 0.1 for pause in pauses)
    assert programs.state == "BACKOFF"


def test_a_program_is_given_up_after_all_retries_and_can_be_revived(programs: Programs) -> None:
    programs.main = fail
    programs.simulation.run(5200.0)
    assert len(programs.starts) == 101
    assert programs.state == "FATAL"
    programs.main = sleep
    programs.supervisor.revive("sentinel")
    programs.simulation.run(2.0)
    assert programs.state == "RUNNING"


def test_a_sentinel_that_stops_asking_is_killed(programs: Programs) -> None:
    programs.simulation.run(1.0)
    programs.supervisor.watch()
    programs.simulation.run(2.9)
    assert len(programs.starts) == 1
    programs.simulation.run(0.3)
    assert len(programs.starts) == 2


def test_a_sentinel_that_never_asks_is_killed_after_half_a_minute(programs: Programs) -> None:
    programs.simulation.run(29.9)
    assert len(programs.starts) == 1
    programs.simulation.run(0.4)
    assert len(programs.starts) == 2


def test_the_processes_of_a_dead_supervisor_are_orphans(programs: Programs) -> None:
    programs.simulation.run(2.0)
    process = programs.process
    programs.supervisor.die()
    assert process.parent_pid == 1
    process.send_signal(signal.SIGKILL)
    programs.simulation.run(5.0)
    assert programs.starts == [0.0]
