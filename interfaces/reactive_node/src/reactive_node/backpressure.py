"""Back-pressure for slow work: the newest item replaces those that wait (Rx: ``onBackpressureLatest``)."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from reactivex import Observable, abc
from reactivex.disposable import CompositeDisposable, Disposable

_T = TypeVar("_T")
_R = TypeVar("_R")
_NOTHING: Any = object()  # an item may be None


def latest(
    work: Callable[[_T], _R], workers: abc.SchedulerBase
) -> Callable[[Observable[_T]], Observable[_R]]:
    """Return an operator that maps items by slow work on another thread, for ``observable.pipe(…)``.

    One item is in work at a time; of those that arrive meanwhile, only the newest waits, so a flood takes no
    memory. Results are emitted by the scheduler of the subscription, ``node.scheduler``; without one, that is
    an error. The next run begins when the last result has been emitted, so results do not pile up either.

    An error of the work or of the source is an error of the observable; CancelledError, SystemExit and the
    like become a RuntimeError. When the source completes, the items in work and in waiting are finished
    first. Disposing drops both.

    :param work: called with an item on ``workers``; returns the result.
    :param workers: the scheduler that runs the work, such as RxPY's ``ThreadPoolScheduler(1)``; in a test,
        :meth:`reactive_node.testing.VirtualTime.worker`.
    """

    def operator(source: Observable[_T]) -> Observable[_R]:
        def subscribe(
            observer: abc.ObserverBase[_R], scheduler: abc.SchedulerBase | None = None
        ) -> abc.DisposableBase:
            if scheduler is None:
                raise ValueError("latest() emits by a scheduler: subscribe(…, scheduler=node.scheduler)")
            worker = _Worker(work, workers, scheduler, observer)
            subscription = source.subscribe(
                worker.take, observer.on_error, worker.complete, scheduler=scheduler
            )
            return CompositeDisposable(subscription, Disposable(worker.stop))

        return Observable(subscribe)

    return operator


class _Worker(Generic[_T, _R]):
    """The item in work and the newest that waits, of one subscription."""

    def __init__(
        self,
        work: Callable[[_T], _R],
        workers: abc.SchedulerBase,
        scheduler: abc.SchedulerBase,
        observer: abc.ObserverBase[_R],
    ) -> None:
        self._work = work
        self._workers = workers
        self._scheduler = scheduler
        self._observer = observer
        self._lock = threading.Lock()  # the source may emit on another thread than the scheduler's
        self._busy = False
        self._waiting = _NOTHING
        self._source_completed = False
        self._stopped = False

    def take(self, item: _T) -> None:
        """Begin to work on an item, or let it replace the one that waits."""
        with self._lock:
            if self._busy:
                self._waiting = item
                return
            self._busy = True
        self._begin(item)

    def complete(self) -> None:
        with self._lock:
            self._source_completed = True
            if self._busy:
                return
        self._observer.on_completed()

    def stop(self) -> None:
        with self._lock:
            self._stopped = True
            self._waiting = _NOTHING

    def _begin(self, item: _T) -> None:
        def run(*_: Any) -> None:
            if self._stopped:
                return
            try:
                result = self._work(item)
            except Exception as error:
                self._fail(error)
            except BaseException as error:  # Rx passes only an Exception on
                failure = RuntimeError(f"the work raised {error!r}")
                failure.__cause__ = error
                self._fail(failure)
            else:
                self._scheduler.schedule(lambda *_: self._deliver(result))

        self._workers.schedule(run)

    def _fail(self, error: Exception) -> None:
        self._scheduler.schedule(lambda *_: self._observer.on_error(error))

    def _deliver(self, result: _R) -> None:
        self._observer.on_next(result)
        with self._lock:
            item, self._waiting = self._waiting, _NOTHING
            self._busy = item is not _NOTHING
            completed = self._source_completed and not self._busy
        if completed:
            self._observer.on_completed()
        elif item is not _NOTHING:
            self._begin(item)
