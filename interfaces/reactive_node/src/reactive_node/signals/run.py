"""The evaluation of a signal for one subscriber, which waits until values are known."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol

from reactivex import abc
from reactivex.disposable import CompositeDisposable, SerialDisposable

from reactive_node import stamps
from reactive_node.scheduler import NodeScheduler
from reactive_node.signals.source import SECOND, Memory, Source

_SET = SECOND  # a clock that jumps by more was set
_FASTEST = 20  # times as fast as the steady clock: a simulation that gains more was set
_SHORTEST = 1e-6  # s, the resolution of Rx's clocks
_FEW = 16  # looks whose memory is not worth a clean-up


class Node(Protocol):
    """A signal that is being evaluated."""

    def at(self, time: int, /) -> tuple[Any, int]:
        """Return value and mark at a time [ns] that was needed and is known."""

    def needs(self, low: int, high: int, /) -> None:
        """Note that an answer needs the values from ``low`` to ``high``, relative to its time [ns]."""


class Questions(Protocol):
    """The times for which a signal is asked."""

    def answer(self, horizon: int, /) -> None:
        """Answer what is asked up to a time [ns]."""

    def next(self) -> int | None:
        """Return the earliest time without an answer [ns]; ``None`` if nothing is asked."""

    def is_done(self, are_complete: bool, /) -> bool:
        """Return whether nothing will be asked any more; all sources may be complete."""

    def restart(self, now: int, /) -> None:
        """Ask from a time on [ns]: the clock was set."""


class Run:
    """One evaluation, from its subscription to its disposal."""

    def __init__(
        self, observer: abc.ObserverBase[Any], scheduler: abc.SchedulerBase | None, steady: bool
    ) -> None:
        if scheduler is None:
            raise ValueError("a signal needs a clock: subscribe(…, scheduler=node.scheduler)")
        self.observer = observer
        self._scheduler = scheduler
        self._steady = steady
        self._nodes: dict[Any, Any] = {}
        self._sources: list[Source] = []
        self._memories: list[Memory] = []
        self._questions: Questions
        self._longest_wait: int
        """How long it takes at most until a value is known [ns]."""
        self._unforgotten = 0  # looks since the last clean-up
        self._timer = SerialDisposable()
        self._armed_for: int | None = None  # [ns]
        self._latest = 0  # the latest time by the clock of the stamps [ns]
        self._before: tuple[int, int] | None = None  # by that clock, and by the steady one [ns]

    def now(self) -> int:
        """Return the present time by the clock of the stamps [ns]; begin again if it was set."""
        scheduler = self._scheduler
        if isinstance(scheduler, NodeScheduler):
            now, steady = scheduler.time_of_stamps(), time.monotonic_ns()
            slowest, fastest = (0, _FASTEST) if scheduler.is_simulated else (1, 1)
        else:
            now = steady = stamps.to_nanoseconds(scheduler.now)
            slowest = fastest = 1
        latest, (before, steady_before) = self._latest, self._before or (now, steady)
        gained, passed = now - before, steady - steady_before
        if now < latest - _SET or not slowest * passed - _SET <= gained <= fastest * passed + _SET:
            self._restart(now)
            latest = now
        self._latest, self._before = max(latest, now), (now, steady)
        return now

    def node(self, signal: Any) -> Any:
        """Return the node of a signal; a signal that several others use is evaluated once."""
        if signal not in self._nodes:
            self._nodes[signal] = signal.begin(self)
        return self._nodes[signal]

    def add(self, memory: Memory) -> None:
        """Feed a source, and let a memory forget."""
        self._memories.append(memory)
        if isinstance(memory, Source):
            self._sources.append(memory)

    def start(self, questions: Questions) -> abc.DisposableBase:
        """Begin to receive samples and to answer."""
        self._questions = questions
        self._longest_wait = max((source.wait + source.high for source in self._sources), default=0)
        subscriptions = [
            source.samples.subscribe(
                source.receive, self.observer.on_error, source.complete, scheduler=self._scheduler
            )
            for source in self._sources
        ]
        self.advance()
        return CompositeDisposable(*subscriptions, self._timer)

    def advance(self) -> None:
        """Answer what has become known; steady answers wait for their timer."""
        if self._steady and self._armed_for is not None:
            return
        try:
            self._advance(self.now())
        except Exception as error:
            self.observer.on_error(error)

    def _advance(self, now: int) -> None:
        horizon = now - self._longest_wait if self._steady else now
        for source in self._sources:
            known = source.settle(now) - source.high
            if known < horizon:
                horizon = known
        self._questions.answer(horizon)
        are_complete = bool(self._sources) and all(source.is_complete for source in self._sources)
        if self._questions.is_done(are_complete):
            self.observer.on_completed()
            return
        self._unforgotten += 1
        if self._unforgotten == _FEW:
            self._unforgotten = 0
            for memory in reversed(self._memories):  # those first that are made from others
                memory.forget(horizon + memory.low)  # what was asked up to there is answered
        self._arm(now)

    def _restart(self, now: int) -> None:
        for memory in self._memories:
            memory.restart(now)
        self._questions.restart(now)
        self._armed_for = None

    def _arm(self, now: int) -> None:
        """Look again when the next answer is due at the latest: a source that is silent does not call."""
        asked = self._questions.next()
        if asked is None:
            return
        due = asked + self._longest_wait
        if self._armed_for is not None and self._armed_for <= due:
            return  # it looks early, and then is armed again
        self._armed_for = due

        def look(*_: Any) -> None:
            self._armed_for = None
            self.advance()

        delay = max((due - now) / SECOND, _SHORTEST)
        self._timer.disposable = self._scheduler.schedule_relative(delay, look)


def evaluation(
    signal: Any, ask: Callable[[Run, Node], Questions], *, before: int = 0, steady: bool = False
) -> Callable[[abc.ObserverBase[Any], abc.SchedulerBase | None], abc.DisposableBase]:
    """Return how to subscribe to the answers of a signal.

    :param before: how far before its time an answer needs values [ns].
    :param steady: whether each answer comes when it is known at the latest.
    """

    def subscribe(
        observer: abc.ObserverBase[Any], scheduler: abc.SchedulerBase | None = None
    ) -> abc.DisposableBase:
        run = Run(observer, scheduler, steady)
        node: Node = run.node(signal)
        node.needs(-before, 0)
        return run.start(ask(run, node))

    return subscribe
