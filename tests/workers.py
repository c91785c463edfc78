"""Does work on all processors that this process may use, each piece in a worker process."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from deploy.supervision import interruption
from deploy.supervision.errors import DeploymentError

Piece = TypeVar("Piece")
Result = TypeVar("Result")

POLL = 0.2  # s between two looks for Ctrl-C
_PR_SET_PDEATHSIG = 1  # of <sys/prctl.h>


def done(
    work: Callable[[Piece], Result],
    pieces: Sequence[Piece],
    begin: Callable[..., None],
    arguments: tuple[Any, ...],
    *,
    method: str,
) -> Iterator[Result]:
    """Do all pieces of work; yield the results in order.

    Raises Interrupted after a signal, and DeploymentError when a worker is killed.

    :param begin: what each worker does first, with these arguments.
    :param method: by which workers start: ``spawn``, or ``fork`` to share what this process has in memory.
    """
    workers = min(len(os.sched_getaffinity(0)), len(pieces))
    context = multiprocessing.get_context(method)
    with ProcessPoolExecutor(workers, context, _begin, (os.getpid(), begin, *arguments)) as pool:
        try:
            futures = deque(pool.submit(work, piece) for piece in pieces)
            while futures:
                yield _result(futures.popleft())
        except BrokenProcessPool:
            raise DeploymentError(
                "A worker process was killed, perhaps because memory ran out."
                " Fewer at a time need less of it: taskset --cpu-list 0 make ..."
            ) from None
        finally:
            for worker in multiprocessing.active_children():
                worker.kill()


def _begin(parent: int, begin: Callable[..., None], *arguments: Any) -> None:
    """Begin; from now on, the worker ends with its parent, even if that is killed."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it has ended before
        os._exit(1)
    begin(*arguments)


def _result(future: Future[Result]) -> Result:
    while True:
        interruption.check()
        try:
            return future.result(POLL)
        except TimeoutError:
            if future.done():  # the work itself has raised it
                raise
