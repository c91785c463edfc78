"""The outside observer: records all topics, processes and faults of the arms into one file.

It runs in a process that the system does not know. Faults arrive on standard input, a JSON object a line; the
end of standard input ends the record. ::

    python -m deploy.chaos.observer RECORD NAMESPACE=DOMAIN=RUN_DIRECTORY ...
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions

from deploy.chaos.history import NO_TARGET, OVERLOAD, InjectedFault, Life
from deploy.chaos.process_monitor import ProcessMonitor
from deploy.chaos.record import FAULTS, PROCESSES, Recorder, qos_profiles
from interfaces import topics

DEPTH = 200  # messages that may wait while the observer is not scheduled
HEARTBEAT_DEPTH = 10  # a flood of heartbeats need not be recorded in full


@contextmanager
def _on_thread(work: Callable[[threading.Event], None]) -> Iterator[None]:
    """Run a function on a thread until the end of the `with`, which raises the function's exception."""
    ended = threading.Event()
    with ThreadPoolExecutor(1) as pool:
        done = pool.submit(work, ended)
        try:
            yield
        finally:
            ended.set()
        done.result()


@contextmanager
def _recording(namespace: str, domain: int, recorder: Recorder) -> Iterator[None]:
    """Record the messages of an arm on a thread."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor(context=context)
    node = Node(f"observer_{os.getpid()}", context=context, namespace=namespace)
    executor.add_node(node)
    for topic in topics.CONTRACT:
        _record(node, topic, recorder)

    def spin(ended: threading.Event) -> None:
        while not ended.is_set():
            executor.spin_once(timeout_sec=0.1)

    with _on_thread(spin):
        yield
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown(context=context)


def _record(node: Node, topic: topics.Topic, recorder: Recorder) -> None:
    """Record a topic; print `seen NAME` at its first message."""
    name = node.resolve_topic_name(topic.name)
    offered = qos_profiles(topic)
    seen = False

    def write(data: bytes, info: Any) -> None:
        nonlocal seen
        if not seen:
            seen = True
            sys.stdout.write(f"seen {name}\n")  # in one write: other threads report other arms
            sys.stdout.flush()
        now = time.monotonic_ns()
        age = time.time_ns() - info["source_timestamp"]
        recorder.message(name, topic.type_name, offered, data, now, now - age)

    depth = HEARTBEAT_DEPTH if topic is topics.OPERATOR_HEARTBEAT else DEPTH
    qos = QoSProfile(depth=depth, reliability=topic.qos.reliability, durability=topic.qos.durability)
    node.create_subscription(topic.type, name, write, qos, raw=True)


def main(arguments: list[str]) -> int:
    """Observe until standard input ends; the first line of output is the origin of the record's times."""
    path, arms = Path(arguments[0]), [text.split("=", 2) for text in arguments[1:]]
    origin = time.monotonic()
    recorder = Recorder(path, round(origin * 1e9), time.time_ns())

    def write(topic: str, event: dict[str, Any], *times: str) -> None:
        relative = {key: event[key] - origin for key in times if event[key] is not None}
        recorder.event(topic, time.monotonic_ns(), event | relative)

    def report(namespace: str, life: Life) -> None:
        write(PROCESSES, life._asdict() | {"namespace": namespace}, "began", "ended")

    def overload(begin: float, end: float) -> None:
        write(FAULTS, InjectedFault(OVERLOAD, NO_TARGET, begin, end)._asdict(), "begin", "end")

    monitor = ProcessMonitor({Path(run): namespace for namespace, _, run in arms}, report, overload)
    with ExitStack() as stack:
        for namespace, domain, _ in arms:
            stack.enter_context(_recording(namespace, int(domain), recorder))
        stack.enter_context(_on_thread(monitor.run))
        stack.callback(recorder.close)  # first, and for all arms at once: shutting the nodes down takes time
        print(f"observing {origin}", flush=True)
        for line in sys.stdin:
            write(FAULTS, json.loads(line), "begin", "end")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
