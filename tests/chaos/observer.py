"""The outside observer: records all topics, processes and faults of the arms into one file.

It runs in a process that the system does not know. Faults arrive on standard input, a JSON object a line; the
end of standard input ends the record. ::

    python -m tests.chaos.observer RECORD NAMESPACE=DOMAIN=RUN_DIRECTORY ...
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
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from mcap_files import SAVE_PERIOD
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from deploy.supervision.recorder import Recorder, clocks, record
from interfaces.service import UserError, enclave, middleware
from reactive_node import ReactiveNode
from tests.chaos.process_monitor import SCAN_PERIOD, ProcessMonitor, Rounds
from tests.promises.history import LOSS, OVERLOAD, Condition, Life
from tests.promises.marks import is_babble
from tests.promises.observations import FAULTS, PROCESSES

OBSERVER = "observer"


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
def _recording(
    namespace: str,
    domain: int,
    recorder: Recorder,
    lost: Callable[[float, float], None],
    overload: Callable[[float, float], None],
) -> Iterator[None]:
    """Record the messages of an arm on a thread; print `seen NAME` at the first message of each topic.

    :param lost: receives begin and end of each time in which messages to the observer were lost.
    :param overload: receives begin and end of each time in which the thread was not scheduled.
    """
    context = Context()
    try:
        with middleware.without_shared_memory():
            rclpy.init(
                args=[*middleware.WITHOUT_LOG_FILES, *enclave.arguments(OBSERVER, namespace)],
                context=context,
                domain_id=domain,
                signal_handler_options=SignalHandlerOptions.NO,
            )
            node = ReactiveNode(f"{OBSERVER}_{os.getpid()}", context=context, namespace=namespace)
    except (RuntimeError, UserError) as error:  # of the domain, discovery, DDS or keys
        sys.exit(f"The observer cannot join the ROS graph: {error}")
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    record(node, recorder, _report_first, lost, is_babble)

    def spin(ended: threading.Event) -> None:
        rounds = Rounds(overload)
        while not ended.is_set():
            executor.spin_once(timeout_sec=SCAN_PERIOD)
            rounds.note(time.monotonic())

    with _on_thread(spin):
        yield
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown(context=context)


def _report_first(name: str) -> None:
    sys.stdout.write(f"seen {name}\n")  # in one write: other threads report other arms
    sys.stdout.flush()


def _save(recorder: Recorder, ended: threading.Event) -> None:
    while not ended.wait(SAVE_PERIOD):
        recorder.save()


def main(arguments: list[str]) -> int:
    """Observe until standard input ends; the first line of output is the origin of the record's times."""
    path, arms = Path(arguments[0]), [text.split("=", 2) for text in arguments[1:]]
    begin, epoch = clocks()
    recorder = Recorder(path, begin, epoch)
    origin = begin / 1e9

    def write(topic: str, event: dict[str, Any], *times: str) -> None:
        relative = {key: event[key] - origin for key in times if event[key] is not None}
        recorder.event(topic, time.monotonic_ns(), event | relative)

    def report(namespace: str, life: Life) -> None:
        write(PROCESSES, life._asdict() | {"namespace": namespace}, "began", "ended")

    def blind(kind: str, begin: float, end: float) -> None:
        write(FAULTS, Condition(kind, begin, end)._asdict(), "begin", "end")

    lost, overload = partial(blind, LOSS), partial(blind, OVERLOAD)
    monitor = ProcessMonitor({Path(run): namespace for namespace, _, run in arms}, report, overload)
    with ExitStack() as stack:
        for namespace, domain, _ in arms:
            stack.enter_context(_recording(namespace, int(domain), recorder, lost, overload))
        stack.enter_context(_on_thread(monitor.run))
        stack.enter_context(_on_thread(partial(_save, recorder)))
        stack.callback(recorder.close)  # first, and for all arms at once: shutting the nodes down takes time
        print(f"observing {origin}", flush=True)
        for line in sys.stdin:
            write(FAULTS, json.loads(line), "begin", "end")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except OSError as error:  # such as a full disk
        sys.exit(f"{error.filename}: {error.strerror}")
