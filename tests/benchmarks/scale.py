"""What grows with numbers: arms on one machine, and subscribers of one topic.

Arms run the demo, each in a ROS domain of its own or all in one. They are started as a user starts them, one
after the other, until the machine is full.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from deploy.supervision import interruption
from deploy.supervision.environment import NAMESPACE
from deploy.supervision.processes import ROOT
from deploy.supervision.rclpy_choice import sourced_rclpy
from deploy.supervision.system import System
from reactive_node.domains import reserved_domain
from tests.benchmarks.alternatives import Alternative
from tests.benchmarks.measurement import MeasurementFailed, Scenario, measure_subscribers
from tests.benchmarks.table import Results, table
from tests.chaos.arm import RealArm
from tests.chaos.cost import Cost

SIZES = (1, 2, 5, 10, 20, 30)
OWN_DOMAINS = "arms, each in a ROS domain of its own"
ONE_DOMAIN = "arms, all in one ROS domain"
SUBSCRIBERS = "subscribers of a topic"
FULL = 0.9  # of all cores: further arms would only take time from each other
SETTLE = 5.0  # s after a start
SECONDS = 20.0  # s of a measurement
LAUNCH = [sys.executable, "-m", "deploy.commands.launcher", "start"]
RESTART = [sys.executable, "-m", "tests.benchmarks.restart"]
RATE = 100.0  # Hz of the topic with many subscribers
_LOOK = 0.1  # s between two looks for an interruption

Rows = Iterator[tuple[str, dict[str, float]]]
"""Figures by name, each with its number of arms or subscribers."""
_ARM = {
    "started": "all started after [s]",
    "cpu": "CPU of an arm [% of a core]",
    "megabytes": "proportional set size of an arm [MB]",
    "packets": "packets of an arm [1/s]",
    "last_start": "start of the last arm [s]",
    "restart": "a killed service is heard again after [s]",
}
_ITEM = {"publisher_us": "CPU of the publisher [µs/item]", "subscriber_us": "CPU of a subscriber [µs/item]"}
HEADINGS = {OWN_DOMAINS: _ARM, ONE_DOMAIN: _ARM, SUBSCRIBERS: _ITEM}
"""The figures of each kind of number."""


class Fleet:
    """Arms on this machine; they end with the block."""

    def __init__(self, directory: Path, *, shared: bool, scenario: str = "demo") -> None:
        """:param shared: whether all arms are in one ROS domain."""
        self.arms: list[RealArm] = []
        self._directory = directory
        self._shared = shared
        self._scenario = scenario
        self.domain = 0
        """The ROS domain of the last arm."""
        self._stack = ExitStack()

    def __enter__(self) -> Fleet:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def start(self) -> None:
        """Start one more arm, and wait for its services. Raises MeasurementFailed if it does not start."""
        name = f"arm{len(self.arms) + 1}"
        arm = RealArm(f"/{name}", System(self._directory / name))
        if not self.domain or not self._shared:
            self.domain = self._stack.enter_context(reserved_domain())
        environment = os.environ | {
            "ROS_DOMAIN_ID": str(self.domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "REACTIVE_ARM_RUN_DIR": str(arm.system.run),
            NAMESPACE: arm.namespace,
        }
        self._stack.callback(arm.system.stop)
        process = subprocess.Popen(
            [*LAUNCH, self._scenario],
            cwd=ROOT,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C reaches only this process, which stops the arms
        )
        self._stack.callback(_end, process)
        while process.poll() is None:
            _wait(_LOOK)
        if process.returncode:
            assert process.stderr is not None
            words = process.stderr.read().split("\n")
            raise MeasurementFailed(f"arm {len(self.arms) + 1} does not start: {words[0]}")
        self.arms.append(arm)

    def restart(self) -> float:
        """Kill a service of the last arm, and return how long it takes until the next one is heard [s].

        :raises MeasurementFailed: if it is not heard.
        """
        environment = self.arms[-1].environment()
        done = subprocess.run(RESTART, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            reason = done.stderr.strip().rpartition("\n")[2]
            raise MeasurementFailed(f"the restart of a service of arm {len(self.arms)}: {reason}")
        return float(done.stdout)

    def cost(self, seconds: float = SECONDS) -> dict[str, float]:
        """Return what one arm costs: percent of a core, MB of proportional set size, packets per second."""
        before, packets = Cost.now(self.arms), _packets()
        _wait(seconds)
        after = Cost.now(self.arms)
        elapsed, count = after.time - before.time, len(self.arms)
        return {
            "cpu": 100 * (after.busy - before.busy) / elapsed / count,
            "megabytes": after.memory / count,
            "packets": (_packets() - packets) / elapsed / count,
        }


def measure() -> Iterator[tuple[str, str, dict[str, float]]]:
    """Yield the figures of each kind, with their number; print why a kind ends early."""
    kinds = {OWN_DOMAINS: fleet(shared=False), ONE_DOMAIN: fleet(shared=True), SUBSCRIBERS: subscribers()}
    for kind, rows in kinds.items():
        try:
            for number, figures in rows:
                shown = ", ".join(f"{HEADINGS[kind][name]} {value:.1f}" for name, value in figures.items())
                print(f"{number} {kind}: {shown}", flush=True)
                yield kind, number, figures
        except MeasurementFailed as end:
            print(f"{kind}: {end}", flush=True)


def tables(results: Mapping[str, Results]) -> str:
    return "\n\n".join(table(kind, rows, HEADINGS[kind]) for kind, rows in results.items())


def fleet(*, shared: bool, sizes: Sequence[int] = SIZES) -> Rows:
    """Yield the cost of one arm among several, until the machine is full or an arm does not start."""
    temporary = tempfile.TemporaryDirectory(prefix="fleet-", ignore_cleanup_errors=True)
    with temporary as directory, Fleet(Path(directory), shared=shared) as arms:
        starting = last = 0.0
        for size in sizes:
            while len(arms.arms) < size:
                began = time.monotonic()
                arms.start()
                last = time.monotonic() - began
                starting += last
            _wait(SETTLE)
            figures = arms.cost()
            yield str(size), {"started": starting, **figures, "last_start": last, "restart": arms.restart()}
            if figures["cpu"] * size > FULL * 100 * len(os.sched_getaffinity(0)):
                raise MeasurementFailed(f"the machine is full with {size} arms")


def subscribers(sizes: Sequence[int] = SIZES) -> Rows:
    """Yield what one item costs its publisher and one of its subscribers [µs]."""
    here = Alternative("ReactiveNode", "reactive", ros=bool(sourced_rclpy()))
    for size in sizes:
        yield str(size), measure_subscribers(here, Scenario("subscribers", 8, RATE), size)


def _packets() -> int:
    lines = Path("/proc/net/dev").read_text().splitlines()
    (counts,) = (line.partition(":")[2] for line in lines if line.strip().startswith("lo:"))
    return int(counts.split()[1])


def _wait(seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while (left := deadline - time.monotonic()) > 0:
        interruption.check()
        time.sleep(min(left, _LOOK))


def _end(process: subprocess.Popen[str]) -> None:
    process.terminate()
    process.communicate()
