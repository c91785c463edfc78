"""Two hosts that a network joins, and what happens to it: network namespaces, which need root and iproute2.

The robot's host runs the arm, the operator's host the dead man's switch; the observer sits on the robot. The
bridge between them stands in a third namespace: the network of the machine itself is not touched.
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

from deploy.chaos.arena import SCENARIO, Arena, ArmUnderTest
from deploy.chaos.faults import FAULTS, Fault, Undo
from deploy.chaos.faults import Arm as Victim
from deploy.chaos.history import OPERATOR
from deploy.chaos.schedule import Planned
from deploy.supervision import processes
from deploy.supervision.system import System

ROBOT, CONTROL, SWITCH = "robot", "operator", "switch"
NETWORK = "10.86.86"  # of the namespaces only
UNSEEN = "dead_mans_switch"  # runs on the operator's host

CUT, LASTING = 5.0, 12.0  # s
SCHEDULES = {name: [Planned(CUT, name, OPERATOR, LASTING)] for name in ("partition", "bad_line")}
"""The named scenarios."""
LENGTH = CUT + LASTING + 12.0  # s; Cyclone DDS needs up to 8 s to discover again what it had given up

NETEM = ("netem", "loss", "20%", "delay", "100ms", "50ms", "reorder", "25%", "50%")
"""A bad line, for tc; not every kernel has it."""

HELD: dict[str, Any] = {
    **{key: value for key, value in SCENARIO.items() if key != "repeat"},
    "operator": {"pressed": [{"from": 0.0}]},
    "engines": [{"at": 1.5, "command": "turn_on"}],
}
"""The operator holds the switch all the time, and turns the engines on once."""


def missing(scenario: str = "partition") -> str:
    """What this machine lacks for a scenario, in words; '' for nothing."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    if shutil.which("ip") is None or shutil.which("tc") is None:
        return "network namespaces need iproute2"
    try:
        with namespaces() as full:
            if scenario == "bad_line":
                _queue(full(SWITCH), "replace", *NETEM)
            return ""
    except subprocess.CalledProcessError as error:
        what = "netem" if error.cmd[0] == "tc" else "network namespaces, veth or bridge"
        return f"this kernel has no {what}: {error.stderr.strip()}"


@contextmanager
def namespaces() -> Iterator[Callable[[str], str]]:
    """Both hosts and the switch, joined; gives the full name of each. Deletes what a killed monkey left."""

    def full(name: str) -> str:
        return f"arm{os.getpid()}-{name}"

    _delete_abandoned()
    with ExitStack() as stack:
        for name in (SWITCH, ROBOT, CONTROL):
            _ip("netns", "add", full(name))
            stack.callback(_ip, "netns", "delete", full(name))
        _ip("-n", full(SWITCH), "link", "add", "bridge", "type", "bridge")
        _ip("-n", full(SWITCH), "link", "set", "bridge", "up")
        for number, name in enumerate((ROBOT, CONTROL), start=1):
            pair = ("link", "add", "eth0", "type", "veth", "peer", "name", name, "netns", full(SWITCH))
            _ip("-n", full(name), *pair)
            _ip("-n", full(name), "address", "add", f"{NETWORK}.{number}/24", "dev", "eth0")
            for device in ("lo", "eth0"):
                _ip("-n", full(name), "link", "set", device, "up")
            _ip("-n", full(SWITCH), "link", "set", name, "master", "bridge")
            _ip("-n", full(SWITCH), "link", "set", name, "up")
        yield full


def _delete_abandoned() -> None:
    """Delete the namespaces of monkeys that live no more."""
    for name, pid in re.findall(r"^(arm(\d+)-\w+)", _ip("netns", "list"), re.MULTILINE):
        if not Path("/proc", pid).exists():
            with suppress(subprocess.CalledProcessError):  # another monkey was faster
                _ip("netns", "delete", name)


def _ip(*arguments: str) -> str:
    return subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True).stdout


def _queue(switch: str, verb: str, *kind: str) -> None:
    """Change how packets wait in the switch for the hosts."""
    for host in (ROBOT, CONTROL):
        command = ["tc", "-n", switch, "qdisc", verb, "dev", host, "root", *kind]
        subprocess.run(command, check=True, capture_output=True, text=True)


class TwoHosts(Arena):
    """An arm on the robot's host, its dead man's switch on the operator's, and what befalls the network."""

    lead = 4.0  # s: both hosts have to start before the operator's only `turn_on`

    discovery = "SUBNET"

    def __init__(self, directory: Path, **options: Any) -> None:
        super().__init__(directory, scenario=HELD, **options)
        self._runs = directory
        self._name: Callable[[str], str] = str
        self.faults = {
            **FAULTS,
            "partition": Fault(self._cut, (OPERATOR,)),
            "bad_line": Fault(self._worsen, (OPERATOR,)),
        }

    def prepare(self, stack: ExitStack) -> None:
        """Make the hosts and their network."""
        self._name = stack.enter_context(namespaces())
        within = {name: ("ip", "netns", "exec", self._name(name)) for name in (ROBOT, CONTROL)}
        self.observed_within = within[ROBOT]
        self.arms = [ArmUnderTest("/", System(self._runs / "run", within[ROBOT]))]
        self._on_operators_host = within[CONTROL]
        self._operator = System(self._runs / "run_operator")
        self._operator.run.mkdir()  # by it the next play finds the switch, should this one be killed
        stack.callback(self._operator.stop)

    def start(self, arm: ArmUnderTest, parameters: Mapping[str, object]) -> None:
        """Start the arm, and on the operator's host the switch alone: nobody observes what runs there."""
        arm.system.start(parameters)
        arm.system.halt(UNSEEN)
        service = [sys.executable, "-m", f"services.{UNSEEN}"]
        subprocess.Popen(
            [*self._on_operators_host, *service, "--ros-args", "--params-file", str(arm.system.parameters)],
            cwd=processes.ROOT,
            env={**os.environ, processes.MARK: str(self._operator.run), "SUPERVISOR_PROCESS_NAME": UNSEEN},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for the monkey
        )

    def _cut(self, arm: Victim, target: str) -> Undo:
        """Take the operator's port of the switch down, and up again in the end."""
        _ip("-n", self._name(SWITCH), "link", "set", CONTROL, "down")

        def heal() -> None:
            with suppress(subprocess.CalledProcessError):
                _ip("-n", self._name(SWITCH), "link", "set", CONTROL, "up")

        return heal

    def _worsen(self, arm: Victim, target: str) -> Undo:
        """Lose, delay and reorder what the hosts send to each other."""
        _queue(self._name(SWITCH), "replace", *NETEM)

        def mend() -> None:
            with suppress(subprocess.CalledProcessError):
                _queue(self._name(SWITCH), "delete")

        return mend
