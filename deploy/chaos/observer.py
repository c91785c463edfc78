"""The outside observer: records all topics of some arms, and the lives of their processes, into one file.

A process of its own, of which the system knows nothing. The monkey tells it its faults on standard input, a
JSON object a line; the end of standard input ends the record. ::

    python -m deploy.chaos.observer RECORD NAMESPACE=DOMAIN=RUN_DIRECTORY ...
"""

from __future__ import annotations

import json
import os
import select
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions

from deploy.chaos.history import NOTHING, OVERLOAD, Fault, Life
from deploy.chaos.marks import BABBLER
from deploy.chaos.record import FAULTS, PROCESSES, Recorder, qos_profiles
from deploy.supervision import processes
from interfaces import topics

STALL = 0.1  # s for a look: the machine is overloaded, and tells of itself more than of the arms
LOOK = 0.02  # s between two looks for new processes
UNNAMED = 0.5  # s within which a new process shows what program it runs
FORK = 0.2  # s that a child of supervisord may look like it
DEPTH = 200  # messages that may wait while the observer is not scheduled
THINNED = 10  # heartbeats that may: of a flood not all are worth recording


class Arm(NamedTuple):
    """What is observed."""

    namespace: str
    domain: int
    run: Path

    @classmethod
    def parse(cls, text: str) -> Arm:
        """From `NAMESPACE=DOMAIN=RUN_DIRECTORY`."""
        namespace, domain, run = text.split("=", 2)
        return cls(namespace, int(domain), Path(run))


@contextmanager
def meanwhile(work: Callable[[threading.Event], None]) -> Iterator[None]:
    """Do it on a thread of its own until the end of the `with`, which raises what it has raised."""
    ended = threading.Event()
    with ThreadPoolExecutor(1) as pool:
        done = pool.submit(work, ended)
        try:
            yield
        finally:
            ended.set()
        done.result()


@contextmanager
def listening(arm: Arm, recorder: Recorder) -> Iterator[None]:
    """Record, on a thread of its own, what is said in an arm's domain."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=arm.domain, signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor(context=context)
    node = Node(f"observer_{os.getpid()}", context=context, namespace=arm.namespace)
    executor.add_node(node)
    listen(node, recorder)

    def spin(ended: threading.Event) -> None:
        while not ended.is_set():
            executor.spin_once(timeout_sec=0.1)

    with meanwhile(spin):
        yield
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown(context=context)


def listen(node: Node, recorder: Recorder) -> None:
    """Record every topic of the contract; say `seen NAME` on standard output when one comes first."""
    for topic in topics.CONTRACT:
        name = node.resolve_topic_name(topic.name)
        depth = THINNED if topic is topics.OPERATOR_HEARTBEAT else DEPTH
        qos = QoSProfile(depth=depth, reliability=topic.qos.reliability, durability=topic.qos.durability)
        callback = _writer(recorder, name, topic)
        node.create_subscription(topic.type, name, callback, qos, raw=True)


def _writer(recorder: Recorder, name: str, topic: topics.Topic) -> Callable[[bytes, Any], None]:
    qos = qos_profiles(topic)
    seen = False

    def write(data: bytes, info: Any) -> None:
        nonlocal seen
        if not seen:
            seen = True
            sys.stdout.write(f"seen {name}\n")  # at once, as other arms are seen by other threads
            sys.stdout.flush()
        now = time.monotonic_ns()
        age = time.time_ns() - info["source_timestamp"]
        recorder.message(name, topic.type_name, qos, data, now, now - age)

    return write


class Census:
    """Knows the processes of the arms: sees new ones within 20 ms, and the end of each at once."""

    def __init__(
        self,
        arms: Iterable[Arm],
        report: Callable[[str, Life], None],
        overload: Callable[[float, float], None],
    ) -> None:
        self._arms = {str(arm.run): arm.namespace for arm in arms}
        self._report = report
        self._overload = overload
        self._poll = select.poll()
        self._known: set[int] = set()
        self._pending: dict[int, float] = {}
        self._alive: dict[int, tuple[str, Life]] = {}

    def run(self, ended: threading.Event) -> None:
        """Take the census until the end."""
        while not ended.is_set():
            before = time.monotonic()
            self.look()
            ready = self._poll.poll(LOOK * 1000)
            if (now := time.monotonic()) - before > STALL:
                self._overload(before, now)
            for handle, _ in ready:
                self._end(handle, time.monotonic())
        for handle in list(self._alive):
            os.close(handle)

    def look(self) -> None:
        """See what is new."""
        pids = {int(name) for name in os.listdir("/proc") if name.isdigit()}
        now = time.monotonic()
        self._pending |= dict.fromkeys(pids - self._known, now)
        self._known = pids
        for pid, since in list(self._pending.items()):
            if self._is_named(pid, now - since) or (now - since > UNNAMED and not self._is_to_be(pid)):
                del self._pending[pid]

    def _is_named(self, pid: int, known: float) -> bool:
        """Whether it is clear what a process is that is known for so long; one of an arm is reported."""
        environment = processes.environment_of(pid)
        namespace = self._arms.get(environment.get(processes.MARK, ""))
        program = environment.get("SUPERVISOR_PROCESS_NAME", "")
        if namespace is None or program == BABBLER or not (program or "supervisord" in _command(pid)):
            return False
        if not program and (known < FORK or self._is_to_be(pid)):
            return False
        try:
            handle = os.pidfd_open(pid)
            began = _began(pid)
        except (OSError, ValueError, IndexError):
            return True
        life = Life(program, pid, began, None)
        self._alive[handle] = (namespace, life)
        self._poll.register(handle, select.POLLIN)
        self._report(namespace, life)
        return True

    def _is_to_be(self, pid: int) -> bool:
        """Whether a process is a child of a supervisord, and so is to become one of its programs."""
        parent = processes.stat_of(pid)[1:2]
        return any(not life.program and [str(life.pid)] == parent for _, life in self._alive.values())

    def _end(self, handle: int, now: float) -> None:
        self._poll.unregister(handle)
        os.close(handle)
        namespace, life = self._alive.pop(handle)
        self._report(namespace, life._replace(ended=now))


def _began(pid: int) -> float:
    """When a process was started, on the monotonic clock."""
    ticks = int(processes.stat_of(pid)[19])
    suspended = time.clock_gettime(time.CLOCK_BOOTTIME) - time.monotonic()
    return ticks / os.sysconf("SC_CLK_TCK") - suspended


def _command(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    except OSError:
        return ""


def main(arguments: list[str]) -> int:
    """Observe until standard input ends; the first line of output is the origin of the record's times."""
    path, arms = Path(arguments[0]), [Arm.parse(text) for text in arguments[1:]]
    origin = time.monotonic()
    recorder = Recorder(path, round(origin * 1e9), time.time_ns())

    def relative(event: dict[str, Any], *keys: str) -> dict[str, Any]:
        return event | {key: event[key] - origin for key in keys if event[key] is not None}

    def report(namespace: str, life: Life) -> None:
        event = relative(life._asdict(), "began", "ended") | {"namespace": namespace}
        recorder.event(PROCESSES, time.monotonic_ns(), event)

    def overload(begin: float, end: float) -> None:
        event = relative(Fault(OVERLOAD, NOTHING, begin, end)._asdict(), "begin", "end")
        recorder.event(FAULTS, time.monotonic_ns(), event)

    def obey() -> None:
        print(f"observing {origin}", flush=True)
        for line in sys.stdin:
            event = relative(json.loads(line), "begin", "end")
            recorder.event(FAULTS, time.monotonic_ns(), event)

    with ExitStack() as stack:
        for arm in arms:
            stack.enter_context(listening(arm, recorder))
        stack.enter_context(meanwhile(Census(arms, report, overload).run))
        stack.callback(recorder.close)  # first, and so for all at once: to stop listening takes time
        obey()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
