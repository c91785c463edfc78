"""Runs experiments on all processors."""

from __future__ import annotations

import gc
import signal
import tempfile
from collections.abc import Iterator, Sequence

from tests import workers
from tests.chaos.schedule_file import Experiment
from tests.simulation.outcome import simulate
from tests.simulation.summary import Summary


def summaries(experiments: Sequence[Experiment]) -> Iterator[Summary]:
    """Run experiments; yield their summaries in order. Raises as :func:`tests.workers.done`."""
    with tempfile.TemporaryDirectory(prefix="reactive-arm-") as directory:
        yield from workers.done(_summarize, experiments, _prepare, (directory,), method="spawn")


def _prepare(directory: str) -> None:
    """Leave Ctrl-C to the parent process, which ends this one and removes what it leaves."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tempfile.tempdir = directory
    gc.freeze()  # looking through all that was imported, again and again, would take a seventh of the time
    gc.set_threshold(20_000)


def _summarize(experiment: Experiment) -> Summary:
    return Summary.of(simulate(experiment))
