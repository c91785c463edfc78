"""Runs the processes of one measurement and returns its figures."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deploy.supervision import interruption
from reactive_node.domains import reserved_domain
from tests.benchmarks.alternatives import Alternative
from tests.benchmarks.link import (
    FIRST,
    HEARTBEATS,
    KINEMATICS,
    LAST,
    MIDDLE,
    REPORTS,
    SINK,
    SOURCE,
    VELOCITY,
    WATCHDOG,
    Job,
)
from tests.chaos.cost import proportional_set_size

_SILENCE = 20.0  # s without a report that an alternative may take
_GRACE = 3.0  # s to end
_LOOK = 0.2  # s between two looks for an interruption


class MeasurementFailed(Exception):
    """Why there are no figures; a message for the user."""


@dataclass(frozen=True)
class Scenario:
    name: str
    """`pipeline`, `flood`, `start`, `subscribers`, `chain` (angle to speed) or `watchdog`."""
    size: int
    """The size of an item [octets]."""
    rate: float
    """The rate of the source [Hz]; 0: as fast as it can."""
    warm_up: float = 0.5
    """From the first item until the measurement [s]; connections and caches have settled by then."""
    seconds: float = 1.5
    """The time of the measurement."""

    @property
    def key(self) -> str:
        """The beginning of the names of its figures."""
        return f"{self.name}.{self.rate if self.name in (CHAIN, WATCHDOG) else self.size:.0f}"

    @property
    def middle(self) -> tuple[str, ...]:
        """The roles between sink and source, the last one first."""
        return {"pipeline": (MIDDLE,), CHAIN: (VELOCITY, KINEMATICS)}.get(self.name, ())

    @property
    def charged(self) -> tuple[str, ...]:
        return self.middle or (SINK,)


CHAIN = "chain"
SCENARIOS = (
    Scenario("pipeline", 8, 200.0),
    Scenario("pipeline", 1_000, 200.0),
    Scenario("pipeline", 1_000_000, 20.0),
    Scenario("pipeline", 10_000_000, 4.0),
    Scenario("flood", 8, 0.0),
    Scenario("flood", 1_000, 0.0),
    Scenario("flood", 1_000_000, 0.0),
    Scenario("flood", 10_000_000, 0.0),
    Scenario("start", 8, 1000.0),
)
# A service reports its health once a second, and reads the whole discovery for its first report. That belongs
# to its start, so services warm up longer.
CHAIN_SCENARIOS = tuple(
    Scenario(CHAIN, 8, rate, warm_up=2.0, seconds=2.0) for rate in (100.0, 500.0, 1000.0, 4000.0)
)
WATCHDOG_SCENARIOS = tuple(Scenario(WATCHDOG, 1, rate, warm_up=2.0, seconds=3.0) for rate in (20.0, 10_000.0))


def measure(alternative: Alternative, scenario: Scenario) -> dict[str, float]:
    """Return the figures by name, with the scenario's key. Raises MeasurementFailed without figures."""
    if scenario.name == WATCHDOG:
        return _measure_watchdog(alternative, scenario)
    roles = (SINK, *scenario.middle, SOURCE)
    with _run(alternative, roles, scenario) as run:
        began = run.start()
        first = run.report(SINK, "first")
        if scenario.name == "start":
            return {f"{scenario.key}.seconds": first["time"] - began}
        pids = [run.pids[role] for role in scenario.charged]
        end, cpu = _cost(run, pids, scenario.seconds)
        megabytes = sum(map(proportional_set_size, pids))
        threads = sum(len(os.listdir(f"/proc/{pid}/task")) for pid in pids)
    figures = {"cpu_us": sum(cpu), "megabytes": megabytes, "threads": threads}
    if scenario.name == "flood":
        figures["per_second"] = end["count"] / end["seconds"]
    else:
        sent = end.get("sent") or scenario.rate * end["seconds"]
        delivered = 100 * end["count"] / sent
        figures |= {"p50_ms": end["p50"], "p99_ms": end["p99"], "delivered": min(100.0, delivered)}
    return {f"{scenario.key}.{name}": value for name, value in figures.items()}


def _measure_watchdog(alternative: Alternative, scenario: Scenario) -> dict[str, float]:
    with _run(alternative, (WATCHDOG, SOURCE), scenario) as run:
        run.start()
        time.sleep(scenario.warm_up)  # until it hears the heartbeats
        began, before = time.monotonic(), cpu_seconds(run.pids[WATCHDOG])
        time.sleep(scenario.seconds)
        busy = cpu_seconds(run.pids[WATCHDOG]) - before
        return {f"{scenario.key}.cpu_percent": 100 * busy / (time.monotonic() - began)}


def measure_subscribers(alternative: Alternative, scenario: Scenario, count: int) -> dict[str, float]:
    """Return an item's processor time in its publisher and each subscriber [µs]. Raises MeasurementFailed."""
    with _run(alternative, (*[SINK] * count, SOURCE), scenario) as run:
        run.start()
        _, (publisher, subscriber) = _cost(run, [run.pids[SOURCE], run.pids[SINK]], scenario.seconds)
    return {"publisher_us": publisher, "subscriber_us": subscriber}


def _cost(run: _Run, pids: Sequence[int], seconds: float) -> tuple[dict[str, Any], list[float]]:
    """Return what the sink has seen at the end, and the processor time of an item in each process [µs].

    The source keeps sending, so this process may read the clocks later than the sink reports, if the time
    between both readings is that of the measurement.
    """
    run.report(SINK, "begin")
    began, before = time.monotonic(), [cpu_seconds(pid) for pid in pids]
    end = run.report(SINK, "end")
    time.sleep(max(0.0, began + seconds - time.monotonic()))
    items = end["count"] / end["seconds"] * (time.monotonic() - began)
    return end, [1e6 * (cpu_seconds(pid) - busy) / items for pid, busy in zip(pids, before, strict=True)]


def cpu_seconds(pid: int) -> float:
    """Return the processor time of a process, with all its threads, ended ones included."""
    return time.clock_gettime(~pid << 3 | 2)  # the kernel's name of this clock: clock_getcpuclockid(3)


@contextmanager
def _run(alternative: Alternative, roles: Sequence[str], scenario: Scenario) -> Iterator[_Run]:
    """Prepare a process for each role, in a ROS domain and a directory of their own."""
    temporary = tempfile.TemporaryDirectory(prefix="bench-", ignore_cleanup_errors=True)
    with reserved_domain() as domain_id, temporary as directory:
        topic = HEARTBEATS if WATCHDOG in roles else FIRST if MIDDLE in roles else LAST
        fields = (topic, scenario.size, scenario.rate, scenario.warm_up, scenario.seconds, directory)
        jobs = [Job(alternative.link, role, *fields) for role in roles]
        with _Run(alternative, jobs, domain_id) as run:
            yield run


class _Run:
    """The processes of one measurement; they end with the block."""

    def __init__(self, alternative: Alternative, jobs: Sequence[Job], domain_id: int) -> None:
        self._alternative = alternative
        self._jobs = jobs
        self._directory = jobs[0].directory
        self._environment = alternative.environment | {
            "ROS_DOMAIN_ID": str(domain_id),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }
        self._processes: list[subprocess.Popen[bytes]] = []
        self._stack = ExitStack()
        self._seen: list[dict[str, Any]] = []
        self.pids: dict[str, int] = {}

    def __enter__(self) -> _Run:
        with ExitStack() as stack:
            self._reports = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
            self._reports.bind(f"{self._directory}/{REPORTS}")
            self._reports.settimeout(_LOOK)
            self._errors = stack.enter_context(open(f"{self._directory}/errors", "wb"))
            stack.callback(self._end)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def start(self) -> float:
        """Start the source when the others listen; return the time of its start [s, monotonic]."""
        *listeners, source = self._alternative.commands(self._alternative, self._jobs)
        for command in listeners:
            self._popen(command)
        waiting = [job.role for job in self._jobs if job.role != SOURCE]
        for role in set(waiting):
            self.pids[role] = int(self.report(role, "ready", waiting.count(role))["pid"])
        began = time.monotonic()
        self.pids[SOURCE] = self._popen(source)
        return began

    def _popen(self, command: list[str]) -> int:
        process = subprocess.Popen(
            command,
            env=self._environment,
            cwd=self._directory,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._errors,
            start_new_session=True,  # Ctrl-C reaches only the harness, which ends them
        )
        self._processes.append(process)
        return process.pid

    def report(self, role: str, event: str, count: int = 1) -> dict[str, Any]:
        """Wait for a number of reports of the processes with a role; return the first."""
        deadline = time.monotonic() + _SILENCE
        while True:
            reports = [each for each in self._seen if (each["role"], each["event"]) == (role, event)]
            if len(reports) >= count:
                return reports[0]
            interruption.check()
            with suppress(TimeoutError):
                self._seen.append(json.loads(self._reports.recv(65536)))
                continue
            if any(process.poll() is not None for process in self._processes):
                raise MeasurementFailed(self._last_words() or "a process ended early")
            if time.monotonic() > deadline:
                raise MeasurementFailed(f"no {event!r} of the {role} within {_SILENCE:.0f} s")

    def _last_words(self) -> str:
        lines = Path(self._directory, "errors").read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else ""

    def _end(self) -> None:
        for process in reversed(self._processes):
            process.terminate()
        for process in self._processes:
            try:
                process.wait(_GRACE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
