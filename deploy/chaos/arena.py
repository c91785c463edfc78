"""Where the monkey plays: arms of its own, each in a ROS domain of its own, under observation.

An arm has eleven processes, and in a domain each process meets every other one: a fleet in one domain would
keep a small machine busy with nothing else.

::

    with Arena(directory) as arena:
        arena.play([schedule])
    history = record.load(arena.record)
"""

from __future__ import annotations

import heapq
import itertools
import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any

import yaml

from deploy.chaos.faults import FAULTS, INJECTED
from deploy.chaos.history import LOSS, NOTHING, OPERATOR, PROGRAMS, SILENCE, Fault, suffix
from deploy.chaos.schedule import AWAKE, FIRST, PERIOD, Planned, Schedule
from deploy.supervision import processes
from deploy.supervision.system import NAMESPACE, SETTINGS, DeploymentError, System
from interfaces import topics
from reactive_node.domains import reserved_domain

UP = 60.0  # s until an arm has to be up
LEAD = 1.0  # s from the start to the origin of the scenario
COMPLETION = 30.0  # s that the observer has to complete its record
READY = 2.0  # s that a fault waits for a victim that is just being restarted
AWAITED = [t for t in topics.CONTRACT if t not in (topics.ENGINES, topics.DIAGNOSTICS)]
"""What is seen of an arm that is up; its operator holds the switch from the beginning."""

SCENARIO: dict[str, Any] = {
    "l1": {"center": 2.0, "amplitude": 0.3, "period": 11.0, "rate": 10.0},
    "l2": {"center": 3.0, "amplitude": 0.3, "period": 17.0, "rate": 10.0},
    "theta1": {"center": 0.8, "amplitude": 0.8, "period": 13.0},
    "theta2": {"center": 0.8, "amplitude": 0.5, "period": 7.0},
    "operator": {"pressed": [{"from": 0.0, "to": AWAKE}]},
    "engines": [{"at": at, "command": topics.TURN_ON} for at in (1.5, 11.5, 20.5, 28.5)],
    "repeat": PERIOD,
}
"""Everything moves; the operator's day has a minute, of which he sleeps the last quarter."""


class ArmUnderTest:
    """An arm that the monkey may break."""

    def __init__(self, namespace: str, system: System) -> None:
        self.namespace = namespace
        self.system = system
        self.domain = 0  # ROS_DOMAIN_ID
        self._environment: dict[str, str] = {}

    def pid(self, program: str) -> int:
        """The process of a program; waits a little for one that is just being restarted, 0 if in vain."""
        deadline = time.monotonic() + READY
        while True:
            with suppress(DeploymentError):
                for each in self.system.programs():
                    if each.name == program and each.state == "RUNNING":
                        return each.pid
            if time.monotonic() > deadline:
                return self._orphan(program)
            time.sleep(0.02)

    def _orphan(self, program: str) -> int:
        return next((p.pid for p in self.system.members() if p.program == program), 0)

    def environment(self) -> dict[str, str]:
        """The environment of the arm's processes, also while none lives."""
        self._environment = self.system.environment() or self._environment
        return self._environment


class Arena:
    """One or more arms, and an observer that records them until the end of the `with`."""

    lead = LEAD
    discovery = "LOCALHOST"  # ROS_AUTOMATIC_DISCOVERY_RANGE

    def __init__(
        self,
        directory: Path,
        namespaces: tuple[str, ...] = ("/",),
        scenario: Mapping[str, Any] = SCENARIO,
        say: Callable[[str], None] = lambda text: None,
        check: Callable[[], None] = lambda: None,
        loss: float = 0.0,
    ) -> None:
        """
        :param directory: for the record and the runtime files; does not exist yet
        :param say: is told what the monkey does
        :param check: is called often, and raises what is to end the play
        :param loss: of the packets that a process sends [%]; by Cyclone DDS, as not every kernel has netem
        """
        self.record = directory / "record.mcap"
        self.arms = [ArmUnderTest(name, System(directory / f"run{suffix(name)}")) for name in namespaces]
        self._directory = directory
        self._scenario = scenario
        self._say = say
        self._check = check
        self._loss = loss
        self._stack = ExitStack()
        self._epoch = 0.0
        self._origin = 0.0
        self.faults = FAULTS
        self.observed_within: Sequence[str] = ()

    def __enter__(self) -> Arena:
        with ExitStack() as stack:
            self._directory.mkdir(parents=True)
            scenario = self._directory / "scenario.yaml"
            scenario.write_text(yaml.safe_dump(dict(self._scenario)))
            self.prepare(stack)
            for arm in self.arms:
                arm.domain = stack.enter_context(reserved_domain())
                stack.callback(arm.system.stop)  # after the record's end: an arm that stops is no silent one
            observed = [f"{arm.namespace}={arm.domain}={arm.system.run}" for arm in self.arms]
            environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": self.discovery, **_losing(self._loss)}
            self._observer = stack.enter_context(
                _observer(self.record, observed, environment, self.observed_within)
            )
            lines = _lines(self._observer)
            self._origin = float(_next(lines, UP, self._check, "the observer").removeprefix("observing "))
            self._epoch = time.monotonic() + self.lead
            shared = {
                "scenario": str(scenario),
                "scenario_epoch": round(self._epoch, 3),
                "settings": SETTINGS,
            }
            environment["PYTHONPATH"] = os.pathsep.join(
                [str(INJECTED), *filter(None, [os.environ.get("PYTHONPATH")])]
            )
            for arm in self.arms:
                with _environment(environment | {NAMESPACE: arm.namespace, "ROS_DOMAIN_ID": str(arm.domain)}):
                    self.start(arm, {"/**": {"ros__parameters": shared}})
                arm.environment()
                # One after the other: together they would keep each other from starting.
                self._await_up(arm, lines)
            self._stack = stack.pop_all()
        return self

    def prepare(self, stack: ExitStack) -> None:
        """Make what the systems run in."""

    def start(self, arm: ArmUnderTest, parameters: Mapping[str, object]) -> None:
        """Start an arm."""
        arm.system.start(parameters)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def play(self, schedules: Sequence[Schedule], until: float = 0.0) -> None:
        """Do to each arm what is planned for it, and wait until so many seconds of the scenario are over."""
        begin = self._epoch
        while time.monotonic() > begin + FIRST - 1.0:
            begin += PERIOD  # it took so long until all was up: on the next day, then
        last = max(
            (planned.at + planned.lasting for schedule in schedules for planned in schedule), default=0.0
        )
        self._tell_circumstances(begin, max(until, last) + 60.0)
        order = itertools.count()
        agenda: list[tuple[float, int, Callable[[], None]]] = []
        undone = ExitStack()

        def add(at: float, what: Callable[[], None]) -> None:
            heapq.heappush(agenda, (at, next(order), what))

        def start(arm: ArmUnderTest, planned: Planned) -> None:
            _, kind, target, lasting = planned
            pid = arm.pid(target) if target in PROGRAMS else 0
            self._say(f"{time.monotonic() - self._origin:7.1f} s  {arm.namespace:7} {kind} {target}")
            at = time.monotonic()
            undo = self.faults[kind].do(arm, target)
            self._tell(Fault(kind, target, at, at + lasting, pid), arm.namespace)
            if undo is not None:
                once = _Once(undo)
                undone.callback(once)
                add(at + lasting, once)

        for arm, schedule in zip(self.arms, schedules, strict=True):
            for planned in schedule:
                add(begin + planned.at, partial(start, arm, planned))
        add(begin + until, lambda: None)
        with undone:
            while agenda:
                at, _, what = heapq.heappop(agenda)
                while (wait := at - time.monotonic()) > 0:
                    time.sleep(min(wait, 0.1))
                    self._check()
                what()

    def _tell(self, fault: Fault, namespace: str) -> None:
        assert self._observer.stdin is not None
        self._observer.stdin.write(json.dumps(fault._asdict() | {"namespace": namespace}) + "\n")
        self._observer.stdin.flush()

    def _tell_circumstances(self, begin: float, duration: float) -> None:
        """A lossy network and the operator's sleep are faults too: whoever reads the record has to know."""
        if self._loss:
            for arm in self.arms:
                self._tell(Fault(LOSS, NOTHING, self._epoch - self.lead, begin + duration), arm.namespace)
        pressed = self._scenario["operator"]["pressed"][-1]
        period = self._scenario.get("repeat")
        if period is None or "to" not in pressed:
            return
        for day in range(
            int((begin - self._epoch) // period), int((begin + duration - self._epoch) // period) + 1
        ):
            dawn = self._epoch + day * period
            for arm in self.arms:
                self._tell(Fault(SILENCE, OPERATOR, dawn + pressed["to"], dawn + period), arm.namespace)

    def _await_up(self, arm: ArmUnderTest, lines: queue.Queue[str]) -> None:
        missing = {f"{arm.namespace.rstrip('/')}/{topic.name}" for topic in AWAITED}
        deadline = time.monotonic() + UP
        while missing:
            left = deadline - time.monotonic()
            seen = _next(lines, left, self._check, ", ".join(sorted(missing)))
            missing.discard(seen.removeprefix("seen "))


class _Once:
    """Does something at its first call."""

    def __init__(self, do: Callable[[], None]) -> None:
        self._do: Callable[[], None] | None = do

    def __call__(self) -> None:
        do, self._do = self._do, None
        if do is not None:
            do()


def _losing(percent: float) -> dict[str, str]:
    """The environment that makes Cyclone DDS lose packets."""
    if not percent:
        return {}
    return _configured(f"<Internal><Test><XmitLossiness>{10 * percent:.0f}</XmitLossiness></Test></Internal>")


def _configured(setting: str) -> dict[str, str]:
    """The environment in which Cyclone DDS has one setting more."""
    return {"CYCLONEDDS_URI": ",".join(filter(None, [os.environ.get("CYCLONEDDS_URI"), setting]))}


@contextmanager
def _observer(
    path: Path, arms: Sequence[str], environment: Mapping[str, str], within: Sequence[str]
) -> Iterator[subprocess.Popen[str]]:
    # What has two readers is sent by multicast, and every process of the domain gets it.
    unicast = _configured("<General><AllowMulticast>spdp</AllowMulticast></General>")
    process = subprocess.Popen(
        [*within, sys.executable, "-m", "deploy.chaos.observer", str(path), *arms],
        cwd=processes.ROOT,
        env={**os.environ, **environment, **unicast},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,  # Ctrl-C is for the monkey; the record is completed then
    )
    try:
        yield process
        try:
            process.communicate(timeout=COMPLETION)
        except subprocess.TimeoutExpired:
            raise DeploymentError(
                f"The observer has not completed its record within {COMPLETION:g} s"
            ) from None
        if process.returncode:
            raise DeploymentError(f"The observer has failed: exit code {process.returncode}")
    finally:
        process.kill()
        process.wait()


def _lines(process: subprocess.Popen[str]) -> queue.Queue[str]:
    """What a process says, as far as somebody wants to wait for it."""
    said: queue.Queue[str] = queue.Queue()
    assert process.stdout is not None
    stream = os.fdopen(os.dup(process.stdout.fileno()), "r")

    def read() -> None:
        with stream, suppress(ValueError):
            for line in stream:
                said.put(line.strip())

    threading.Thread(target=read, daemon=True).start()
    return said


def _next(lines: queue.Queue[str], within: float, check: Callable[[], None], awaited: str) -> str:
    """The next line, within so many seconds; `check` is called meanwhile."""
    deadline = time.monotonic() + within
    while time.monotonic() < deadline:
        check()
        with suppress(queue.Empty):
            return lines.get(timeout=0.1)
    raise DeploymentError(f"Nothing is seen of {awaited}")


@contextmanager
def _environment(changes: Mapping[str, str]) -> Iterator[None]:
    before = dict(os.environ)
    os.environ.update(changes)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
