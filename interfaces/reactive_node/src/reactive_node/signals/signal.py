"""Signals and their operations, each with its meaning as one equation.

``s(t)`` is the value of the signal s at the time t. Where a value is unknown, all that is made from it is.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any, Generic, TypeVar

from reactivex import Observable

from reactive_node.signals import values
from reactive_node.signals.answers import CERTAIN, HELD, UNKNOWN, Answer, Refused
from reactive_node.signals.integral import Integral
from reactive_node.signals.questions import Crossings, Events, Grid
from reactive_node.signals.run import Node, Run, evaluation
from reactive_node.signals.source import SECOND, nanoseconds
from reactive_node.stamps import Timestamp

T = TypeVar("T")
R = TypeVar("R")
K = TypeVar("K")
E = TypeVar("E")


class Signal(Generic[T]):
    """A value at every time (the thesis' *behaviour*, 2.3.1).

    A signal is a description, like a cold observable: nothing happens before a subscription to what
    :meth:`sample`, :meth:`snapshot` or :meth:`when` return. Each subscription has its own memory. It needs a
    scheduler with the clock of the stamps, ``node.scheduler``, or virtual time in a test.
    """

    def __init__(self, begin: Callable[[Run], Node]) -> None:
        self.begin = begin

    # Questions

    def sample(self, period: float, *, steady: bool = False) -> Observable[Answer[T]]:
        """Emit the values at all multiples of a period [s]: ``[(t, s(t)) for t = k · period]``.

        The first one follows the subscription. Answers come in the order of time, as soon as they are known.

        :param steady: whether each one comes when it is known at the latest, so that they come at the rate,
            and not in bursts with the samples.
        """
        every = nanoseconds("the period", period)

        def ask(run: Run, node: Node) -> Grid:
            return Grid(run, node, every, run.observer.on_next)

        return Observable(evaluation(self, ask, steady=steady))

    def snapshot(
        self,
        events: Observable[Timestamp[E]],
        *,
        lateness: float,
        refused: Callable[[Refused], None] | None = None,
    ) -> Observable[tuple[E, Answer[T]]]:
        """Emit events with the values at their times: ``[(e, s(t)) for (t, e) in events]``, ordered by time.

        :param lateness: how long after its time an event may arrive [s]; a later one is dropped.
        :param refused: called with each event that was dropped.
        """

        bound = nanoseconds("the lateness", lateness)

        def ask(run: Run, node: Node) -> Events:
            def answer(event: E, answer: Answer[T]) -> None:
                run.observer.on_next((event, answer))

            return Events(run, node, events, answer, lateness=bound, refused=refused)

        return Observable(evaluation(self, ask))

    def when(self, predicate: Callable[[T], bool], *, resolution: float) -> Observable[Timestamp[bool]]:
        """Emit ``p(s(t))`` with the time t of each change, between the samples, to the nanosecond.

        It is false in the beginning. Two changes within the resolution may pass unseen. Only certain values
        count.

        :param resolution: the distance of the times at which the signal is looked at [s].
        """
        every = nanoseconds("the resolution", resolution)

        def ask(run: Run, node: Node) -> Grid:
            return Grid(run, node, every, Crossings(node, predicate, every, run.observer.on_next).look)

        return Observable(evaluation(self, ask, before=every))

    # Operations

    def delay(self, seconds: float) -> Signal[T]:
        """Return ``t ↦ s(t - seconds)``. A negative delay looks ahead, and answers so much later."""
        return Signal(lambda run: _Delayed(run.node(self), round(seconds * SECOND)))

    def derivative(self, over: float) -> Signal[T]:
        """Return the mean rate of change: ``t ↦ (s(t + over/2) - s(t - over/2)) / over`` [1/s].

        At the time of a sample, where lines of two slopes meet, it is the mean of both. The longer the time
        [s], the less noise, and the later the answer. If it is not longer than the gap of the samples, no
        silence goes unnoticed.
        """
        half = nanoseconds("half the time of a derivative", over / 2)
        seconds = 2 * half / SECOND

        def slope(before: T, after: T) -> T:
            return values.slope(before, after, seconds)  # type: ignore[no-any-return]

        return lift(slope)(self.delay(half / SECOND), self.delay(-half / SECOND))

    def integral(self, step: float) -> Signal[T]:
        """
        Return ``t ↦ ∫ s`` from the first known value on, by trapezoids between the multiples of ``step`` [s].

        It is exact for a signal whose slope changes only at these times. Once a value is unknown, so is the
        integral from then on.
        """
        every = nanoseconds("the step", step)
        return Signal(lambda run: Integral(run, run.node(self), every))

    def window(self, seconds: float, step: float) -> Signal[tuple[T, ...]]:
        """Return ``t ↦ (s(t - n · step), …, s(t - step), s(t))`` with n = seconds / step, rounded."""
        nanoseconds("the step", step)
        count = round(seconds / step)
        return lift(lambda *items: items)(*(self.delay(back * step) for back in range(count, -1, -1)))

    def until(self, event: Signal[Any], then: Signal[T]) -> Signal[T]:
        """Return ``t ↦ then(t) if event(t) is known else s(t)``; the event is a signal made with ``hold``."""
        return Signal(lambda run: _Until(run.node(self), run.node(event), run.node(then)))

    def certain_while(self, alive: Signal[bool]) -> Signal[T]:
        """Return ``s``, marked as held where ``alive(t)`` is not true: its publisher was dead."""
        return Signal(lambda run: _WhileAlive(run.node(self), run.node(alive)))

    # Arithmetic, with signals or constants

    def __add__(self, other: Any) -> Signal[Any]:
        return lift(operator.add)(self, other)

    def __radd__(self, other: Any) -> Signal[Any]:
        return lift(operator.add)(other, self)

    def __sub__(self, other: Any) -> Signal[Any]:
        return lift(operator.sub)(self, other)

    def __rsub__(self, other: Any) -> Signal[Any]:
        return lift(operator.sub)(other, self)

    def __mul__(self, other: Any) -> Signal[Any]:
        return lift(operator.mul)(self, other)

    def __rmul__(self, other: Any) -> Signal[Any]:
        return lift(operator.mul)(other, self)

    def __truediv__(self, other: Any) -> Signal[Any]:
        return lift(operator.truediv)(self, other)

    def __rtruediv__(self, other: Any) -> Signal[Any]:
        return lift(operator.truediv)(other, self)

    def __neg__(self) -> Signal[Any]:
        return lift(operator.neg)(self)


def of_time(function: Callable[[int], T]) -> Signal[T]:
    """Return ``t ↦ function(t)``, of the time in ns; known at once."""
    return Signal(lambda run: _OfTime(function))


def constant(value: T) -> Signal[T]:
    """Return ``t ↦ value``."""
    return of_time(lambda time: value)


def lift(function: Callable[..., R]) -> Callable[..., Signal[R]]:
    """Return a function of signals: ``lift(f)(a, b, …)(t) = f(a(t), b(t), …)``.

    Arguments that are no signals are constants.
    """

    def lifted(*arguments: Any) -> Signal[R]:
        signals = [each if isinstance(each, Signal) else constant(each) for each in arguments]
        return Signal(lambda run: _Lifted(function, [run.node(each) for each in signals]))

    return lifted


def switch(key: Signal[K], choices: Mapping[K, Signal[T]]) -> Signal[T]:
    """Return ``t ↦ choices[key(t)](t)``.

    Events choose if the key is made with ``hold``. All choices are evaluated from the beginning on, so the
    time at which an event arrives changes nothing. A key without a choice is unknown.
    """
    return Signal(
        lambda run: _Switched(run.node(key), {name: run.node(each) for name, each in choices.items()})
    )


class _Several:
    def __init__(self, *nodes: Node) -> None:
        self._nodes = nodes

    def needs(self, low: int, high: int) -> None:
        for node in self._nodes:
            node.needs(low, high)


class _Lifted(_Several):
    def __init__(self, function: Callable[..., Any], nodes: list[Node]) -> None:
        super().__init__(*nodes)
        self._function = function
        self._reads = [node.at for node in nodes]

    def at(self, time: int) -> tuple[Any, int]:
        arguments, worst = [], CERTAIN
        for read in self._reads:
            value, mark = read(time)
            if mark > worst:
                if mark == UNKNOWN:
                    return None, UNKNOWN
                worst = mark
            arguments.append(value)
        return self._function(*arguments), worst


class _Delayed:
    def __init__(self, node: Node, delay: int) -> None:
        self._node, self._delay = node, delay
        self._read = node.at

    def needs(self, low: int, high: int) -> None:
        self._node.needs(low - self._delay, high - self._delay)

    def at(self, time: int) -> tuple[Any, int]:
        return self._read(time - self._delay)


class _OfTime:
    def __init__(self, function: Callable[[int], Any]) -> None:
        self._function = function

    def needs(self, low: int, high: int) -> None:
        """It knows all times."""

    def at(self, time: int) -> tuple[Any, int]:
        return self._function(time), CERTAIN


class _Until(_Several):
    def at(self, time: int) -> tuple[Any, int]:
        first, event, then = self._nodes
        _, mark = event.at(time)
        return first.at(time) if mark == UNKNOWN else then.at(time)


class _WhileAlive(_Several):
    def at(self, time: int) -> tuple[Any, int]:
        node, alive = self._nodes
        value, mark = node.at(time)
        is_alive, known = alive.at(time)
        return value, mark if known != UNKNOWN and is_alive else max(mark, HELD)


class _Switched(_Several):
    def __init__(self, key: Node, choices: Mapping[Any, Node]) -> None:
        super().__init__(key, *choices.values())
        self._key, self._choices = key, choices

    def at(self, time: int) -> tuple[Any, int]:
        key, mark = self._key.at(time)
        chosen = None if mark == UNKNOWN else self._choices.get(key)
        if chosen is None:
            return None, UNKNOWN
        value, other = chosen.at(time)
        return value, max(mark, other)
