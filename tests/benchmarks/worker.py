"""One process of a measurement: `python -m tests.benchmarks.worker JOB`, a file with a job.

It reports to the socket of the measurement. It ends on SIGTERM, or when its parent has ended.
"""

from __future__ import annotations

import importlib
import json
import os
import signal
import socket
import sys
import time
from array import array
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

from tests.benchmarks.link import FIRST, LAST, REPORTS, SINK, SOURCE, Job, Link

_TURN = 0.1  # s at most between two looks whether to end


class Reports:
    def __init__(self, job: Job) -> None:
        self._role = job.role
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.connect(f"{job.directory}/{REPORTS}")

    def send(self, event: str, **figures: float) -> None:
        self._socket.send(json.dumps({"role": self._role, "event": event, **figures}).encode())


class Meter:
    """Receives items in the sink, and reports when the measurement begins and what it has seen at its end."""

    def __init__(self, job: Job, reports: Reports, sent: Callable[[], int]) -> None:
        self._job = job
        self._reports = reports
        self._sent = sent
        self._sent_before = 0
        self._phase_began = 0
        self._measuring = False
        self._latencies: list[int] = []

    def receive(self, item: Any) -> None:
        now = time.monotonic_ns()
        self._latencies.append(now - int.from_bytes(item[:8], "little"))
        if not self._phase_began:
            self._phase_began = now
            self._reports.send("first", time=now / 1e9)
        seconds = (now - self._phase_began) / 1e9
        if not self._measuring and seconds >= self._job.warm_up:
            self._measuring, self._phase_began, self._latencies = True, now, []
            self._sent_before = self._sent()
            self._reports.send("begin")
        elif self._measuring and seconds >= self._job.seconds:
            sent = self._sent() - self._sent_before
            self._reports.send("end", seconds=seconds, sent=sent, **self._figures())
            self._phase_began = sys.maxsize  # once

    def _figures(self) -> dict[str, float]:
        ordered = sorted(self._latencies)
        count = len(ordered)
        return {"count": count, "p50": ordered[count // 2] / 1e6, "p99": ordered[count * 99 // 100] / 1e6}


class Life:
    def __init__(self) -> None:
        self._parent = os.getppid()
        self._ended = False
        signal.signal(signal.SIGTERM, self._end)

    def _end(self, number: int, frame: FrameType | None) -> None:
        self._ended = True

    def goes_on(self) -> bool:
        """Whether the parent lives and has not asked for the end."""
        return not self._ended and os.getppid() == self._parent


def publish(link: Link, job: Job, life: Life) -> None:
    """Publish stamped items at the rate of the job; one that is late shifts the following ones."""
    send = link.publisher(job.topic)
    item = array("B", bytes(job.size))
    due = time.monotonic()
    while life.goes_on():
        with memoryview(item) as octets:
            octets[:8] = time.monotonic_ns().to_bytes(8, "little")
        send(item)
        if job.rate:
            now = time.monotonic()
            due = max(due + 1 / job.rate, now)
            time.sleep(due - now)


def main() -> None:
    life = Life()
    job = Job(**json.loads(Path(sys.argv[1]).read_text()))
    reports = Reports(job)
    link: Link = importlib.import_module(f"tests.benchmarks.links.{job.link}").Connection(job)
    try:
        if job.role == SOURCE:
            publish(link, job, life)
            return
        if job.role == SINK:
            link.subscribe(LAST, Meter(job, reports, link.sent).receive)
        else:
            link.forward(FIRST, LAST)
        reports.send("ready", pid=os.getpid())
        while life.goes_on():
            link.wait(_TURN)
    finally:
        link.close()


if __name__ == "__main__":
    main()
