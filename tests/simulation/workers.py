"""Runs experiments on all processors."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import tempfile
from collections.abc import Iterator, Sequence
from multiprocessing.pool import IMapIterator

from deploy.supervision import interruption
from tests.chaos.schedule_file import Experiment
from tests.simulation.outcome import simulate
from tests.simulation.summary import Summary

POLL = 0.2  # s between two looks for Ctrl-C


def summaries(experiments: Sequence[Experiment]) -> Iterator[Summary]:
    """Run experiments; yield their summaries in order. Raises Interrupted on Ctrl-C."""
    context = multiprocessing.get_context("spawn")
    workers = min(os.cpu_count() or 1, len(experiments))
    with (
        tempfile.TemporaryDirectory(prefix="reactive-arm-") as directory,
        context.Pool(workers, _prepare, (directory,)) as pool,
    ):
        results = pool.imap(_summarize, experiments)
        for _ in experiments:
            yield _next(results)


def _next(results: IMapIterator[Summary]) -> Summary:
    while True:
        interruption.check()
        try:
            return results.next(POLL)
        except multiprocessing.TimeoutError:
            continue


def _prepare(directory: str) -> None:
    """Leave Ctrl-C to the parent process, which ends this one and removes what it leaves."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tempfile.tempdir = directory
    gc.freeze()  # looking through all that was imported, again and again, would take a seventh of the time


def _summarize(experiment: Experiment) -> Summary:
    return Summary.of(simulate(experiment))
