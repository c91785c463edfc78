"""A second whole arm on another host, which meets the first one while all engines are off. Needs root.

Both hosts start while they are cut from each other. Then the joint sources of the second one are stopped, so
that each angle in the record is one of the first host's, while both drives are heard.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import yaml

from deploy.supervision.run_directory import scenario_parameters
from deploy.supervision.system import System
from interfaces import topics
from tests.chaos.arm import RealArm
from tests.chaos.faults import FAULT_KINDS, FaultKind, Undo
from tests.chaos.partition import BRIDGE, CONTROL, ROBOT, TwoHosts, namespaces, set_port
from tests.chaos.schedule import PlannedFault
from tests.chaos.testbed import SCENARIO, Testbed
from tests.promises.history import DRIVE, OPERATOR, PARTITION

RELEASED, RELEASED_THERE = 4.0, 5.0  # s at which the operator of each host lets go: the drives differ
CUT, HEALED = 5.0, 22.0  # s; by then the engines of both are off
SILENT = (
    "config_l1",
    "config_l2",
    "config_theta1",
    "config_theta2",
    "kinematics",
    "velocity",
    "twist",
    "robot_state",
)
"""The programs of the second host that stop: nothing names the host of what they publish."""
SCHEDULE = [
    PlannedFault(CUT, PARTITION, OPERATOR, HEALED - CUT),
    *(
        PlannedFault(HEALED + 8.0 + 2.0 * n, "kill", victim)
        for n, victim in enumerate(("config_theta1", DRIVE, "config_theta2", DRIVE))
    ),
]
LENGTH = HEALED + 20.0
AS_HOST = ("unshare", "--uts", "sh", "-c", 'hostname "$0" && exec "$@"', "second")


def scenario(released: float) -> dict[str, Any]:
    """Return a scenario whose operator turns the engines on and lets go."""
    commands = [{"at": at, "command": topics.TURN_ON} for at in (1.5, 2.5)]
    day = {"operator": {"pressed": [{"from": 0.0, "to": released}]}, "engines": commands}
    return {**{key: value for key, value in SCENARIO.items() if key != "repeat"}, **day}


class SecondHost(TwoHosts):
    """A whole arm on the robot's host, and another one on the operator's, cut off from the start."""

    def __init__(self, directory: Path, **options: Any) -> None:
        Testbed.__init__(self, directory, scenario=scenario(RELEASED), **options)
        self._runs = directory
        self.faults = {**FAULT_KINDS, PARTITION: FaultKind(self._part, (OPERATOR,))}

    def prepare(self, stack: ExitStack) -> None:
        self._full = stack.enter_context(namespaces())
        # The device stays up: Fast DDS joins only the networks that are there when it starts.
        set_port(self._full(BRIDGE), CONTROL, "nomaster")
        within = {name: ("ip", "netns", "exec", self._full(name)) for name in (ROBOT, CONTROL)}
        self.observe_within = within[ROBOT]
        self.arms = [RealArm("/", System(self._runs / "run", within[ROBOT]))]
        self._second = System(self._runs / "run_second", (*within[CONTROL], *AS_HOST))
        stack.callback(self._second.stop)

    def start(self, arm: RealArm, parameters: Mapping[str, object]) -> None:
        file = self._runs / "second.yaml"
        file.write_text(yaml.safe_dump(scenario(RELEASED_THERE)))
        self._second.start(scenario_parameters(file, round(self.epoch, 3)))
        arm.system.start(parameters)

    def _part(self, arm: RealArm, target: str) -> Undo:
        """Stop what the second host would publish beside the first one; at the end, the hosts meet."""
        for program in SILENT:
            self._second.halt(program)
        return lambda: set_port(self._full(BRIDGE), CONTROL, "master", "bridge")
