"""Plays timelines as observables, from a time of the scenario on [s since its origin] or by a drive."""

from __future__ import annotations

import math
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any, TypeVar

import reactivex as rx
from reactivex import Observable, abc
from reactivex.scheduler import ImmediateScheduler

from interfaces.sources.timeline import Events, Sweep

T = TypeVar("T")


def state(timeline: Events[T] | Sweep, elapsed: float) -> Observable[Any]:
    """Emit the value that holds, then every change."""
    if isinstance(timeline, Sweep):
        return _samples(timeline, elapsed)
    return _items(timeline.since(elapsed), elapsed)


def driven(timeline: Events[T] | Sweep, times: Observable[float]) -> Observable[Any]:
    """Emit the value at each time of a drive.

    While time passes, a value is emitted when it has changed, as by :func:`state`. While time stands still,
    the value is emitted again and again: a joint that stands publishes where.
    """
    samples = times.map(lambda time: (time, timeline.at(time))).filter(lambda sample: sample[1] is not None)
    pairs = samples.start_with((math.nan, None)).pairwise()
    news = pairs.filter(lambda pair: pair[0][0] == pair[1][0] or pair[0][1] != pair[1][1])
    return news.map(lambda pair: pair[1][1])


def events(timeline: Events[T], elapsed: float, *, resume: bool = False) -> Observable[T]:
    """Emit single events, each once.

    :param resume: whether a process that died has emitted the events up to now; otherwise overdue events are
        emitted at once.
    """
    return _items(timeline.after(elapsed if resume else -1.0), elapsed)


def _items(items: Iterator[tuple[float, T]], elapsed: float) -> Observable[T]:
    def begin(scheduler: abc.SchedulerBase) -> Observable[T]:
        origin = scheduler.now - timedelta(seconds=elapsed)
        return rx.concat_with_iterable(_at(origin + timedelta(seconds=at), value) for at, value in items)

    return rx.defer(begin)


def _at(due: datetime, value: T) -> Observable[T]:
    return rx.timer(due).map(lambda _: value)


def _samples(sweep: Sweep, elapsed: float) -> Observable[float]:
    """Emit the value at the time of emission, so a late timer causes no error; nothing during a rest."""

    def begin(scheduler: abc.SchedulerBase) -> Observable[float]:
        origin = scheduler.now - timedelta(seconds=elapsed)
        ticks = rx.interval(1.0 / sweep.rate).start_with(0)
        times = ticks.map(lambda _: (scheduler.now - origin).total_seconds())
        moving = times.take_while(lambda time: not sweep.rest_left(time), inclusive=True)

        def resting(scheduler: abc.SchedulerBase) -> Observable[float]:
            rest = sweep.rest_left((scheduler.now - origin).total_seconds())
            return rx.timer(math.ceil(rest * sweep.rate) / sweep.rate).ignore_elements()

        return moving.concat(rx.defer(resting)).repeat().map(sweep.at).distinct_until_changed()

    return rx.defer(begin)


def follow(parameter: Observable[T], timeline: Observable[T] | None) -> Observable[T]:
    """Emit the values of a virtual source.

    Without a timeline, these are the parameter's present value and each value that is set. With a timeline,
    they are the timeline's values until the parameter is set by hand, then the parameter's.
    """
    if timeline is None:
        return parameter
    at_once = ImmediateScheduler.singleton()
    return parameter.switch_map_indexed(lambda value, index: rx.just(value, at_once) if index else timeline)
