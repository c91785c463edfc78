"""The testbed: starts arms and an observer, and injects faults by schedule.

Each arm has its own ROS domain. In one domain every process would discover the processes of all arms, which
would keep a small machine busy. ::

    with Testbed(directory) as testbed:
        testbed.inject([schedule])
    history = observations.load(testbed.record)
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
from functools import cache, partial
from pathlib import Path
from typing import Any
from unittest import mock

import ros_yaml

from deploy.security import rights
from deploy.security.keystore import Keystore
from deploy.supervision import interruption, manifest, processes
from deploy.supervision.environment import KEYSTORE, NAMESPACE, SECURITY
from deploy.supervision.errors import DeploymentError
from deploy.supervision.run_directory import scenario_parameters, with_parameters
from deploy.supervision.system import System
from interfaces import topics
from interfaces.service import enclave
from reactive_node.domains import reserved_domain
from tests.chaos import clock
from tests.chaos.arm import RealArm, file_suffix
from tests.chaos.faults import FAULT_KINDS, INJECTED, PROGRAMS, Undo
from tests.chaos.observer import OBSERVER
from tests.chaos.schedule import AWAKE, DAY, FIRST_FAULT, PlannedFault, Schedule
from tests.promises.history import (
    LOSS,
    OUTPUTS,
    SILENCE,
    Condition,
    InjectedFault,
    target_name,
)
from tests.promises.marks import BABBLER

Action = Callable[[], tuple[float, Undo] | None]
"""Returns when and how to end what it began, or ``None``."""

FURTHER_ARM = 2.5  # s from the start of an arm to that of the next
START_TIMEOUT = 60.0  # s until an arm must have output from every program
RECORD_TIMEOUT = 30.0  # s in which the observer must complete its record

SCENARIO: dict[str, Any] = {
    "l1": {"center": 2.0, "amplitude": 0.3, "period": 11.0, "rate": 10.0},
    "l2": {"center": 3.0, "amplitude": 0.3, "period": 17.0, "rate": 10.0},
    "theta1": {"center": 0.8, "amplitude": 0.8, "period": 13.0},
    "theta2": {"center": 0.8, "amplitude": 0.5, "period": 7.0},
    "drive": {},
    "operator": {"pressed": [{"from": 0.0, "to": AWAKE}]},
    "engines": [{"at": at, "command": topics.TURN_ON} for at in (1.5, 11.5, 20.5, 28.5)],
    "repeat": DAY,
}
"""All values move. The operator's day has 45 s; the operator sleeps in the last third."""


def sources(rate: float) -> dict[str, Any]:
    """Return the part of :data:`SCENARIO` that moves the values, with another rate [Hz]."""
    moving = {name: {**SCENARIO[name], "rate": rate} for name in topics.CONFIGURATION}
    return {**moving, "drive": {"rate": rate}}


class Testbed:
    """Arms, and the observer that records them until the end of the `with`."""

    __test__ = False  # pytest must not collect it
    lead = 3.0  # s from the start of the first arm to the origin of the scenario
    discovery_range = "LOCALHOST"  # ROS_AUTOMATIC_DISCOVERY_RANGE

    def __init__(
        self,
        directory: Path,
        namespaces: tuple[str, ...] = ("/",),
        scenario: Mapping[str, Any] = SCENARIO,
        say: Callable[[str], None] = lambda text: None,
        loss: float = 0.0,
        steps_clock: bool = False,
        parameters: Callable[[str], Mapping[str, Any]] = lambda namespace: {},
    ) -> None:
        """:param directory: for the record and the runtime files; must not exist yet.
        :param say: receives a line for each injected fault.
        :param loss: DDS packets that each process loses [%], by Cyclone DDS: not every kernel has netem.
        :param steps_clock: whether the fault `step_clock` can be injected.
        :param parameters: returns the content of a parameter file for the arm in a namespace.
        """
        self.record = directory / "record.mcap"
        self.arms = [RealArm(name, System(directory / f"run{file_suffix(name)}")) for name in namespaces]
        self.lead += FURTHER_ARM * (len(namespaces) - 1)
        self.faults = FAULT_KINDS
        self.observe_within: Sequence[str] = ()  # a command in front of the observer's
        self._directory = directory
        self.scenario = scenario
        self._say = say
        self._loss = loss
        self._steps_clock = steps_clock
        self.parameters_of = parameters
        self._stack = ExitStack()
        self.epoch = 0.0  # origin of the scenario, on the monotonic clock
        self._origin = 0.0  # of the record
        self._seen: set[str] = set()  # topics with a message

    def __enter__(self) -> Testbed:
        with ExitStack() as stack:
            self._directory.mkdir(parents=True)
            self.prepare(stack)
            faked = stack.enter_context(clock.faked()) if self._steps_clock else {}
            for arm in self.arms:
                arm.domain = stack.enter_context(reserved_domain())
                stack.callback(arm.system.stop)  # after the end of the record, which shows no stopping arm
            environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": self.discovery_range, **_cyclone(self._loss)}
            environment |= self._keys()
            lines = self._start_observer(stack, environment)
            parameters = self._parameters()
            path = [str(INJECTED), *filter(None, [os.environ.get("PYTHONPATH")])]
            environment |= {"PYTHONPATH": os.pathsep.join(path), **faked}
            for arm in self.arms:
                arm_environment = {NAMESPACE: arm.namespace, "ROS_DOMAIN_ID": str(arm.domain)}
                arm.parameters = self.parameters_of(arm.namespace)
                with mock.patch.dict(os.environ, environment | arm_environment | arm.clock.environment()):
                    self.start(arm, with_parameters(parameters, arm.parameters))
                arm.environment()
                # One arm after the other: starting together would take each of them too long.
                self.await_messages([arm], [topics.ENGINES_STATE], lines)
            absent = () if "drive" in self.scenario else (topics.DRIVEN_TIME,)
            outputs = [topic for topic in OUTPUTS.values() if topic not in absent]
            self.await_messages(self.arms, outputs, lines)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _keys(self) -> dict[str, str]:
        """Write keys for the arms and for those that watch and disturb them, if security is wanted."""
        if os.environ.get(SECURITY) != "true":
            return {}
        keystore = Keystore(self._directory.resolve() / "keystore")
        keys: dict[str, rights.Rights] = {}
        for arm in self.arms:
            keys |= rights.of_arm(arm.namespace, [program.name for program in manifest.programs()])
            keys[enclave.path(OBSERVER, arm.namespace)] = rights.observer(arm.namespace, OBSERVER)
            keys[enclave.path(BABBLER, arm.namespace)] = rights.babbler(arm.namespace, BABBLER)
        keystore.write(keys, [arm.domain for arm in self.arms])
        return {KEYSTORE: str(keystore.folder)}

    def prepare(self, stack: ExitStack) -> None:
        """Prepare the hosts of the arms."""

    def start(self, arm: RealArm, parameters: Mapping[str, object]) -> None:
        arm.system.start(parameters)

    def inject(self, schedules: Sequence[Schedule], until: float = 0.0) -> None:
        """Inject the faults of a schedule into each arm; wait until ``until`` [s] of the scenario."""
        begin = self.epoch
        while time.monotonic() > begin + FIRST_FAULT - 1.0:
            begin += DAY  # the start took so long: wait for the operator's next day
        planned = [fault for schedule in schedules for fault in schedule]
        self._report_conditions(begin, max([until, *(each.at + each.duration for each in planned)]) + 60.0)
        order = itertools.count()  # of actions at the same time
        actions: list[tuple[float, int, Action]] = [
            (begin + each.at, next(order), partial(self._inject, arm, each))
            for arm, schedule in zip(self.arms, schedules, strict=True)
            for each in schedule
        ]
        actions.append((begin + until, next(order), lambda: None))
        heapq.heapify(actions)
        with ExitStack() as undone:
            while actions:
                at, _, action = heapq.heappop(actions)
                while (wait := at - time.monotonic()) > 0:
                    time.sleep(min(wait, 0.1))
                    interruption.check()
                if lasting := action():
                    end, undo = lasting
                    once: Action = cache(undo)  # at its time, or earlier if the `with` ends
                    undone.callback(once)
                    heapq.heappush(actions, (end, next(order), once))

    def _inject(self, arm: RealArm, planned: PlannedFault) -> tuple[float, Undo] | None:
        _, kind, target, duration = planned
        pid = arm.pid(target) if target in PROGRAMS else 0
        now = time.monotonic()
        self._say(f"{now - self._origin:7.1f} s  {arm.namespace:7} {kind} {target_name(target)}")
        undo = self.faults[kind].inject(arm, target)
        self._record(InjectedFault(kind, target, now, now + duration, pid, arm.clock.ahead), arm)
        return (now + duration, undo) if undo else None

    def _record(self, what: InjectedFault | Condition, arm: RealArm) -> None:
        assert self._observer.stdin is not None
        self._observer.stdin.write(json.dumps(what._asdict() | {"namespace": arm.namespace}) + "\n")
        self._observer.stdin.flush()

    def _report_conditions(self, begin: float, duration: float) -> None:
        """Let the observer record the packet loss and the operator's sleep: the checkers have to know."""
        conditions = []
        if self._loss:
            conditions.append(Condition(LOSS, self.epoch - self.lead, begin + duration))
        pressed, day = self.scenario["operator"]["pressed"][-1], self.scenario.get("repeat")
        if day and "to" in pressed:
            # A day may begin at `begin`, but for the error of floating point.
            first, last = (int((time - self.epoch + 0.001) // day) for time in (begin, begin + duration))
            for morning in (self.epoch + number * day for number in range(first, last + 1)):
                asleep = Condition(SILENCE, morning + pressed["to"], morning + day)
                conditions.append(asleep)
        for arm, condition in itertools.product(self.arms, conditions):
            self._record(condition, arm)

    def _parameters(self) -> dict[str, Any]:
        """Return the parameters of all arms, with an origin of the scenario that they share."""
        scenario = self._directory / "scenario.yaml"
        scenario.write_text(ros_yaml.dump(dict(self.scenario)))
        self.epoch = time.monotonic() + self.lead
        return scenario_parameters(scenario, round(self.epoch, 3))

    def _start_observer(self, stack: ExitStack, environment: Mapping[str, str]) -> queue.Queue[str | None]:
        """Start the observer; return the lines that it prints from now on."""
        arms = [f"{arm.namespace}={arm.domain}={arm.system.run}" for arm in self.arms]
        command = [
            *self.observe_within,
            sys.executable,
            "-m",
            "tests.chaos.observer",
            str(self.record),
            *arms,
        ]
        self._observer = stack.enter_context(_observer(command, environment))
        lines = _lines(self._observer)
        origin = self._next(lines, time.monotonic() + START_TIMEOUT, "The observer does not start")
        self._origin = float(origin.removeprefix("observing "))
        return lines

    def await_messages(
        self, arms: Sequence[RealArm], awaited: Sequence[topics.Topic], lines: queue.Queue[str | None]
    ) -> None:
        """Wait until the observer has seen a message on each topic of each arm; most follow the scenario."""
        names = {topic.full_name(arm.namespace) for arm in arms for topic in awaited}
        deadline = max(time.monotonic(), self.epoch) + START_TIMEOUT
        while missing := names - self._seen:
            line = self._next(lines, deadline, _no_message(sorted(missing), len(arms)))
            self._seen.add(line.removeprefix("seen "))

    def _next(self, lines: queue.Queue[str | None], deadline: float, error: str) -> str:
        while time.monotonic() < deadline:
            interruption.check()
            with suppress(queue.Empty):
                if (line := lines.get(timeout=0.1)) is None:
                    raise DeploymentError("The observer has ended")
                return line
        raise DeploymentError(error)


def _no_message(topic_names: Sequence[str], arms: int) -> str:
    shown, more = ", ".join(topic_names[:3]), len(topic_names) - 3
    others = f" and {more} more topics" if more > 0 else ""
    advice = ": try fewer --arms" if arms > 1 else ""
    return f"No message on {shown}{others} within {START_TIMEOUT:.0f} s{advice}"


def _cyclone(loss: float) -> dict[str, str]:
    """Return Cyclone's settings: without a tag of the arm, which its domain of its own makes needless."""
    lossiness = f"<Internal><Test><XmitLossiness>{10 * loss:.0f}</XmitLossiness></Test></Internal>"
    return _configured(lossiness if loss else "")


def _configured(setting: str) -> dict[str, str]:
    return {"CYCLONEDDS_URI": ",".join(filter(None, [os.environ.get("CYCLONEDDS_URI"), setting]))}


@contextmanager
def _observer(command: Sequence[str], environment: Mapping[str, str]) -> Iterator[subprocess.Popen[str]]:
    """Run the observer; its record is complete at the end of the `with`."""
    # Messages for two readers are multicast to all processes of the domain, unless that is switched off.
    unicast = _configured("<General><AllowMulticast>spdp</AllowMulticast></General>")
    process = subprocess.Popen(
        command,
        cwd=processes.ROOT,
        env={**os.environ, **environment, **unicast},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,  # Ctrl-C at the terminal must not end it: it completes the record
    )
    try:
        yield process
        try:
            process.communicate(timeout=RECORD_TIMEOUT)
        except subprocess.TimeoutExpired:
            reason = f"The observer has not completed its record within {RECORD_TIMEOUT:g} s"
            raise DeploymentError(reason) from None
        if process.returncode:
            raise DeploymentError(f"The observer has failed with exit code {process.returncode}")
    finally:
        process.kill()
        process.wait()


def _lines(process: subprocess.Popen[str]) -> queue.Queue[str | None]:
    """Return the lines that a process prints; ``None`` when it has ended."""
    lines: queue.Queue[str | None] = queue.Queue()
    assert process.stdout is not None
    stream = os.fdopen(os.dup(process.stdout.fileno()), "r")

    def read() -> None:
        with stream, suppress(ValueError):
            for line in stream:
                lines.put(line.strip())
        lines.put(None)

    threading.Thread(target=read, daemon=True).start()
    return lines
