"""An arm in virtual time: the programs of the manifest, unmodified, under a simulated supervisor."""

from __future__ import annotations

import signal
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import ros_yaml
from rclpy_simulation import Delay, Network, Process, Simulation
from rclpy_simulation.host import BOOT, SECOND

from deploy.supervision import manifest
from deploy.supervision.errors import DeploymentError
from deploy.supervision.processes import MARK
from deploy.supervision.run_directory import SETTINGS, scenario_parameters, with_parameters
from deploy.supervision.system import SERVICE_GRACE
from interfaces.service import UserError
from interfaces.sources import scenario_file
from tests.chaos.nested_faults import NestedFaults
from tests.promises.history import SWITCH, Life
from tests.simulation.calibration import Calibration, load
from tests.simulation.machine import simulated_services
from tests.simulation.supervisor import Supervisor

PROGRAMS = tuple(each for each in manifest.programs() if each.name != manifest.PAGE)
"""All but the page, which serves HTTP on threads of its own."""
NAMES = tuple(each.name for each in PROGRAMS)
ROBOT, CONTROL = "robot", "operator"
"""The hosts; the dead man's switch runs on the operator's."""
NO_PARAMETERS: Mapping[str, Any] = {}
LEAD = 1.0  # s from the start of the arm to the origin of the scenario


class SimulatedArm:
    def __init__(
        self,
        simulation: Simulation,
        directory: Path,
        scenario: Mapping[str, Any],
        start_up: Delay,
        parameters: Mapping[str, Any],
        hosts: tuple[str, str] = (ROBOT, CONTROL),
        programs: Collection[str] | None = None,
    ) -> None:
        """Start an arm, at the beginning of a simulation.

        :param directory: for its parameter file and its settings.
        :param start_up: from the start of a process to that of its program.
        :param parameters: the content of a parameter file.
        :param hosts: that of the robot, and that of the dead man's switch.
        :param programs: those that run; by default, all.
        """
        self.simulation = simulation
        self._robot, self._control = hosts
        self._ended: list[Life] = []
        self._start_up = start_up
        self.good_line = simulation.network.loss, simulation.network.latency
        """Packet loss and latency without faults."""
        self.skew = 0.0
        """By which the clock of the operator's host is ahead of the robot's [s]."""
        self.nested = NestedFaults()
        self._directory = directory
        file = directory / "scenario.yaml"
        file.write_text(ros_yaml.dump(dict(scenario)))
        try:
            scenario_file.load(file)
        except UserError as error:
            raise DeploymentError(f"the scenario has an error: {error}") from None
        origin = (BOOT / SECOND) + simulation.now + LEAD
        self.origin = simulation.now + LEAD
        """The beginning of the scenario [s of the simulation]."""
        self.given = parameters
        """The content of the user's parameter file."""
        self.parameters = with_parameters(scenario_parameters(file, origin, directory / SETTINGS), parameters)
        """The content of the parameter file of all services."""
        self._programs = {each.name: each for each in PROGRAMS if programs is None or each.name in programs}
        self.write_parameters()
        self.supervisor = Supervisor(simulation, list(self._programs), self.spawn)

    def process(self, program: str) -> Process | None:
        """Return the supervised process of a program, or an orphan of it."""
        supervised = self.supervisor.process(program)
        if supervised is not None or self.supervisor.is_alive:
            return supervised
        return next((each for each in self.processes() if each.name == program), None)

    def processes(self) -> list[Process]:
        mark = str(self._directory)
        return [each for each in self.simulation.processes if each.environment.get(MARK) == mark]

    def start_again(self) -> None:
        """Start supervisord again over the orphans of the last one, which end first; not if it runs."""
        if not self.supervisor.is_alive:
            for process in self.processes():
                process.send_signal(signal.SIGTERM)
            self.simulation.after(SERVICE_GRACE, self._start_again)

    def _start_again(self) -> None:
        if self.supervisor.is_alive:
            return
        for process in self.processes():
            process.kill()
        self.supervisor = Supervisor(self.simulation, list(self._programs), self.spawn)

    def write_parameters(self) -> None:
        """Write the parameter file that services read when they start."""
        (self._directory / "parameters.yaml").write_text(ros_yaml.dump(self.parameters))

    def spawn(self, name: str, parent: int) -> Process:
        host = self._control if name == SWITCH else self._robot
        process = self._start(name, host, name=name, parent=parent, **{MARK: str(self._directory)})
        began = self.simulation.now

        def note_end() -> None:
            lines = process.output.text.split("\n") if (process.exit_code or 0) > 0 else []
            words = next(filter(str.strip, reversed(lines)), "")
            self._ended.append(Life(name, process.pid, began, self.simulation.now, words))

        process.at_end(note_end)
        return process

    def start_elsewhere(self, name: str, host: str) -> Process:
        """Start a program once more, on a host that does not belong to this arm."""
        return self._start(name, host, name="stranger", parent=1)

    def _start(self, program: str, host: str, *, name: str, parent: int, **environment: str) -> Process:
        given = self._programs[program]
        return self.simulation.start(
            given.module,
            *given.arguments,
            "--ros-args",
            "--params-file",
            str(self._directory / "parameters.yaml"),
            host=host,
            environment={"SUPERVISOR_PROCESS_NAME": program, **environment},
            name=name,
            parent=parent,
            delay=self._start_up,
        )

    def lives(self) -> list[Life]:
        """Return the lives of all processes, dead and alive."""
        alive = [Life(each.name, each.pid, (each.began - BOOT) / SECOND, None) for each in self.processes()]
        return sorted([*self._ended, *alive], key=lambda life: (life.began, life.pid))


@contextmanager
def simulated_arm(
    seed: str,
    directory: Path,
    scenario: Mapping[str, Any],
    durations: Calibration | None = None,
    parameters: Mapping[str, Any] = NO_PARAMETERS,
) -> Iterator[SimulatedArm]:
    """Simulate an arm until the end of the ``with``, by default with the durations of a real arm.

    :param parameters: the content of a parameter file.
    """
    given = durations or load()
    network = Network(latency=given.latency, discovery=given.discovery)
    arm: SimulatedArm
    with simulated_services(seed, network, lambda: [arm.supervisor]) as simulation:
        arm = SimulatedArm(simulation, directory, scenario, given.start_up, parameters)
        yield arm
