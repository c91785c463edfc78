"""One chain of one arm: its replay and the comparison, in a process of its own."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rclpy_simulation.host import SECOND

from interfaces.topics import CONFIGURATION, EFFECTOR_TWIST, ENGINES, Topic
from tests import workers
from tests.replay import chains
from tests.replay.chains import Chain
from tests.replay.comparison import BOUNDS, Comparison, Interval, compare
from tests.replay.lives import lives
from tests.replay.playback import Playback, replay
from tests.replay.record import Message, Record

START = 2 * SECOND
"""After the begin of the record or of a process, in which nothing is compared: processes discover each other
[ns]. It is the longest restart of promise L1."""
CATCH_UP = SECOND  # ns after a suspension in which nothing is compared


class Job(NamedTuple):
    namespace: str
    chain: Chain
    parameters: Path | None
    """A ROS parameter file."""


class Outcome(NamedTuple):
    job: Job
    messages: dict[str, list[Message]]
    """By topic name of the contract, in the order of sending."""
    comparisons: list[Comparison]
    """One for each topic that was recorded."""
    failures: list[tuple[int, str]]
    """When a service ended by itself [ns since 1970], and why."""


def run_all(record: Record, jobs: Sequence[Job]) -> list[Outcome]:
    """Replay chains on all processors. Raises as :func:`tests.workers.done`."""
    return [*workers.done(_run, jobs, _prepare, (record,), method="fork")]  # they share the record


_record: Record


def _prepare(record: Record) -> None:
    global _record
    _record = record
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process ends this one
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _run(job: Job) -> Outcome:
    return run(_record, job)


def run(record: Record, job: Job) -> Outcome:
    record = record.of_arm(job.namespace)
    playback = replay(record, job.namespace, job.chain, job.parameters)
    comparisons = []
    for topic in chains.outputs(job.chain):
        recorded = chains.recorded(record, job.namespace, topic)
        is_compared = topic.name in BOUNDS  # what is only displayed is not
        if is_compared and (recorded or topic is ENGINES):  # which nobody may have sent
            excused = _excused(record, playback, topic, chains.known(record, job.namespace, topic))
            if topic is EFFECTOR_TWIST:
                excused += _without_a_source(record, job.namespace)
            replayed = playback.messages[topic.name]
            comparisons.append(compare(topic, recorded, replayed, excused, record.offsets))
    return Outcome(job, playback.messages, comparisons, playback.failures)


def _excused(record: Record, playback: Playback, topic: Topic, known: int) -> list[Interval]:
    """Return the times in which the output of a chain may differ.

    :param known: from when on the record shows what the output depends on [ns since 1970].
    """
    around = round(BOUNDS[topic.name].time * SECOND)
    found = [(0, max(record.begin, known) + START), (record.end - around, max(record.end, known) + START)]
    for life in (life for each in playback.lives.values() for life in each):
        found.append((life.began - around, life.began + START))
        if life.ended is not None:
            found.append((life.ended - around, life.ended + around))
        found += [(each.begin - around, each.end + CATCH_UP) for each in life.suspensions]
    return found


def _without_a_source(record: Record, namespace: str) -> list[Interval]:
    """Return when a source was dead: then nothing is certain, but the player of the record lives."""
    found = []
    for source in CONFIGURATION.values():
        (publisher,) = source.publishers
        processes = lives(record, namespace, publisher)
        following = [each.began for each in processes[1:]] + [record.end]
        for life, began in zip(processes, following, strict=True):
            if life.ended is not None:
                found.append((life.ended - SECOND, began + START))
    return found
