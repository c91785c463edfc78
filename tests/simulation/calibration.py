"""The durations of a simulation, measured on a real arm.

``make chaos CHAOS='--scenario briefly'`` makes a record, and this module reads it ::

    python -m tests.simulation.calibration .run/chaos/<date>/record.mcap > calibration.json
"""

from __future__ import annotations

import json
import os
import statistics
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from mcap_files import McapFile
from rclpy.serialization import deserialize_message
from rclpy_simulation import Delay

from deploy.supervision.errors import DeploymentError
from interfaces import topics
from tests.promises import lateness, observations
from tests.promises.findings import percentile
from tests.promises.history import SOURCES, History, Life
from tests.promises.promises import CHECKERS

PATH = Path(__file__).with_name("calibration.json")


class Calibration(NamedTuple):
    """Durations of a real arm [s]."""

    start_up: Delay
    """From the start of a process until its node exists."""
    latency: Delay
    """From a writer to a reader."""
    discovery: Delay
    """From the existence of a node until another one receives from it."""
    measured: dict[str, Any]
    """The worst S1 and the percentiles of L1 in the same record, with date and machine."""


@cache
def load() -> Calibration:
    document = json.loads(PATH.read_text(encoding="utf-8"))
    start_up, latency, discovery = (Delay(*document[name]) for name in ("start_up", "latency", "discovery"))
    return Calibration(start_up, latency, discovery, document["measured"])


def measure(path: Path) -> Calibration:
    """Measure the durations in a record of one arm."""
    history = observations.load(path)
    created = _created(path, history)
    silences = [time for times in CHECKERS["L1"](history).times.values() for time in times]
    return Calibration(
        _delay([created[life] - life.began for life in created]),
        _delay(latencies(history)),
        _delay(list(_first_receptions(created, history))),
        {
            "S1": round(CHECKERS["S1"](history).worst, 3),
            "L1": [round(percentile(silences, percent), 3) for percent in (50, 99)],
            "date": time.strftime("%Y-%m-%d"),
            "cores": os.cpu_count(),
        },
    )


def latencies(history: History) -> list[float]:
    """Return how long messages took [s]; heartbeats waited until the recorder looked for them."""
    prompt = {
        name: stream for name, stream in history.streams.items() if name != topics.OPERATOR_HEARTBEAT.name
    }
    known = lateness.from_known_publishers(replace(history, streams=prompt))
    return [each.received - each.sent for each in known]


def _delay(values: Sequence[float]) -> Delay:
    if not values:
        raise DeploymentError("the record is too short for a calibration")
    return Delay(round(statistics.median(values), 5), round(percentile(values, 99), 5))


def _created(path: Path, history: History) -> dict[Life, float]:
    """Return when the node of each restarted process was created, from its first health report."""
    begin = min((fault.begin for fault in history.faults), default=0.0)  # until then, all start together
    lives = {(life.program, life.pid): life for life in history.lives if life.program and life.began > begin}
    created: dict[Life, float] = {}
    with McapFile(path) as file:
        origin = next(int(each.metadata["origin"]) for each in file.metadata)
        for _, message in file.messages(["/diagnostics"]):
            for status in deserialize_message(message.data, DiagnosticArray).status:
                values = {pair.key: pair.value for pair in status.values}
                life = lives.pop((status.name.rpartition("/")[2], int(values.get("pid") or 0)), None)
                if life is not None and "uptime" in values:
                    sent = (message.publish_time - origin) / 1e9
                    created[life] = sent - float(values["uptime"])
    return created


def _first_receptions(created: dict[Life, float], history: History) -> Iterator[float]:
    """Yield how long after the creation of its node the first latched message of a source arrived."""
    for life, begin in created.items():
        if life.program not in SOURCES:
            continue
        first = next((each.received for each in history.output(life.program) if each.sent >= begin), None)
        if first is not None and (life.ended is None or first < life.ended):
            yield first - begin


if __name__ == "__main__":
    document = measure(Path(sys.argv[1]))._asdict()
    print(json.dumps(document, indent=2, default=lambda delay: [delay.median, delay.p99]))
