"""Faults of the network between two hosts, the operator's and the robot's. Needs root and iproute2.

The hosts are network namespaces. The robot's host runs the arm and the observer, the operator's host the dead
man's switch. The bridge between them is in a third namespace, so the network of the machine is not touched.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from deploy.supervision import manifest, processes
from deploy.supervision.system import System
from tests.chaos.arm import RealArm
from tests.chaos.faults import FAULT_KINDS, FaultKind, Undo
from tests.chaos.schedule import PlannedFault
from tests.chaos.testbed import SCENARIO, Testbed
from tests.promises.history import OPERATOR, SWITCH

ROBOT, CONTROL, BRIDGE = "robot", "operator", "switch"
NETWORK = "10.86.86"  # of the namespaces only

BEGIN, DURATION = 5.0, 12.0  # s
SCHEDULES = {name: [PlannedFault(BEGIN, name, OPERATOR, DURATION)] for name in ("partition", "bad_line")}
LENGTH = BEGIN + DURATION + 12.0  # s; Cyclone DDS needs up to 8 s to discover a lost host again

NETEM = ("netem", "loss", "20%", "delay", "100ms", "50ms", "reorder", "25%", "50%")
"""A bad line, for tc; not every kernel has netem."""

HELD: dict[str, Any] = {
    **{key: value for key, value in SCENARIO.items() if key != "repeat"},
    "operator": {"pressed": [{"from": 0.0}]},
    "engines": [{"at": 1.5, "command": "turn_on"}],
}
"""The operator holds the switch all the time and turns the engines on once."""


def missing(scenario: str = "partition") -> str:
    """Return what this machine lacks for a scenario; empty if nothing."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    if shutil.which("ip") is None or shutil.which("tc") is None:
        return "network namespaces need iproute2"
    try:
        with namespaces() as full:
            if scenario == "bad_line":
                _queue(full(BRIDGE), "replace", *NETEM)
            return ""
    except subprocess.CalledProcessError as error:
        module = "netem" if error.cmd[0] == "tc" else "network namespaces, veth or bridge"
        return f"this kernel has no {module}: {error.stderr.strip()}"


@contextmanager
def namespaces(*hosts: str) -> Iterator[Callable[[str], str]]:
    """Create hosts, by default the two, and the bridge; give a function that returns the full name of each.

    Namespaces that a killed chaos monkey left behind are deleted first.
    """

    hosts = hosts or (ROBOT, CONTROL)

    def full(name: str) -> str:
        return f"arm{os.getpid()}-{name}"

    _delete_abandoned()
    with ExitStack() as stack:
        for name in (BRIDGE, *hosts):
            _ip("netns", "add", full(name))
            stack.callback(_ip, "netns", "delete", full(name))
        _ip("-n", full(BRIDGE), "link", "add", "bridge", "type", "bridge")
        _ip("-n", full(BRIDGE), "link", "set", "bridge", "up")
        for number, name in enumerate(hosts, start=1):
            pair = ("link", "add", "eth0", "type", "veth", "peer", "name", name, "netns", full(BRIDGE))
            _ip("-n", full(name), *pair)
            _ip("-n", full(name), "address", "add", f"{NETWORK}.{number}/24", "dev", "eth0")
            # No IPv6: it gets its address a second later, and a browser drops its connections at that change.
            _ip("-n", full(name), "link", "set", "eth0", "addrgenmode", "none")
            for device in ("lo", "eth0"):
                _ip("-n", full(name), "link", "set", device, "up")
            _ip("-n", full(BRIDGE), "link", "set", name, "master", "bridge")
            _ip("-n", full(BRIDGE), "link", "set", name, "up")
        yield full


def _delete_abandoned() -> None:
    for name, pid in re.findall(r"^(arm(\d+)-\w+)", _ip("netns", "list"), re.MULTILINE):
        if not Path("/proc", pid).exists():
            with suppress(subprocess.CalledProcessError):  # another chaos monkey was faster
                _ip("netns", "delete", name)


def set_port(bridge: str, host: str, *how: str) -> None:
    """Set a host's port of the bridge, such as ``down``."""
    _ip("-n", bridge, "link", "set", host, *how)


def _ip(*arguments: str) -> str:
    return subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True).stdout


def _queue(bridge: str, verb: str, *kind: str) -> None:
    for host in (ROBOT, CONTROL):
        command = ["tc", "-n", bridge, "qdisc", verb, "dev", host, "root", *kind]
        subprocess.run(command, check=True, capture_output=True, text=True)


class TwoHosts(Testbed):
    """An arm on the robot's host, its dead man's switch on the operator's host."""

    lead = 4.0  # s: both hosts have to start before the operator's only `turn_on`
    discovery_range = "SUBNET"

    def __init__(self, directory: Path, **options: Any) -> None:
        super().__init__(directory, scenario=HELD, **options)
        self._runs = directory
        self._full: Callable[[str], str] = str
        self.faults = {
            **FAULT_KINDS,
            "partition": FaultKind(self._cut, (OPERATOR,)),
            "bad_line": FaultKind(self._degrade, (OPERATOR,)),
        }

    def prepare(self, stack: ExitStack) -> None:
        self._full = stack.enter_context(namespaces())
        within = {name: ("ip", "netns", "exec", self._full(name)) for name in (ROBOT, CONTROL)}
        self.observe_within = within[ROBOT]
        self.arms = [RealArm("/", System(self._runs / "run", within[ROBOT]))]
        self._on_operators_host = within[CONTROL]
        self._operator = System(self._runs / "run_operator")
        # The run directory lets the next start of the chaos monkey find and end the switch.
        self._operator.forget_settings([SWITCH])
        stack.callback(self._operator.stop)

    def start(self, arm: RealArm, parameters: Mapping[str, object]) -> None:
        """Start the arm without its switch, and the switch alone on the operator's host."""
        program = next(program for program in manifest.programs() if program.name == SWITCH)
        with manifest.chosen("", without=[SWITCH]):
            arm.system.start(parameters)
        service = [sys.executable, "-m", program.module, *program.arguments]
        path = os.pathsep.join([str(processes.ROOT), os.environ.get("PYTHONPATH", "")])
        marks = {processes.MARK: str(self._operator.run), "SUPERVISOR_PROCESS_NAME": SWITCH}
        subprocess.Popen(
            [*self._on_operators_host, *service, "--ros-args", "--params-file", str(arm.system.parameters)],
            cwd=self._operator.run,  # where its settings are
            env={**os.environ, **marks, "PYTHONPATH": path},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C at the terminal must not end it
        )

    def _cut(self, arm: RealArm, target: str) -> Undo:
        """Take the operator's port of the bridge down; at the end, up again."""
        set_port(self._full(BRIDGE), CONTROL, "down")

        def heal() -> None:
            with suppress(subprocess.CalledProcessError):
                set_port(self._full(BRIDGE), CONTROL, "up")

        return heal

    def _degrade(self, arm: RealArm, target: str) -> Undo:
        _queue(self._full(BRIDGE), "replace", *NETEM)

        def heal() -> None:
            with suppress(subprocess.CalledProcessError):
                _queue(self._full(BRIDGE), "delete")

        return heal
