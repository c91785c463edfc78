"""Plays timelines as observables."""

from __future__ import annotations

import math
from datetime import timedelta
from typing import Any, TypeVar

import reactivex as rx
from reactivex import Observable, abc
from reactivex.disposable import MultipleAssignmentDisposable
from reactivex.scheduler import TimeoutScheduler

from interfaces.scenario.timeline import Timeline

T = TypeVar("T")


def play(timeline: Timeline[T], elapsed: float, *, resume: bool = True) -> Observable[T]:
    """
    Return a timeline as an observable that does not drift.

    :param elapsed: where in time it starts [s]; negative while the origin is still to come.
    :param resume: whether the value that holds already is emitted first, at once. Right for a state, wrong
    for
        events: what a restarted source has said before its death it does not say again.
    """

    def subscribe(
        observer: abc.ObserverBase[T], scheduler: abc.SchedulerBase | None = None
    ) -> abc.DisposableBase:
        clock = scheduler or TimeoutScheduler.singleton()
        origin = clock.now - timedelta(seconds=elapsed)
        upcoming = timeline.after(elapsed if resume else math.nextafter(elapsed, -math.inf))
        pending = MultipleAssignmentDisposable()

        def wait() -> None:
            for at, value in upcoming:
                due = origin + timedelta(seconds=at)
                if timeline.catches_up or due >= clock.now:
                    pending.disposable = clock.schedule_absolute(due, emit, value)
                    return
            observer.on_completed()

        def emit(_: abc.SchedulerBase, value: Any) -> None:
            observer.on_next(value)
            wait()

        present = timeline.at(elapsed) if resume else None
        if present is not None:
            observer.on_next(present)
        wait()
        return pending

    return Observable(subscribe)


def follow(parameter: Observable[T], timeline: Observable[T] | None) -> Observable[T]:
    """
    Return what a virtual source does that has a parameter and may have a timeline.

    Without a timeline that is the parameter's value at once, then what is set. With one, it is the timeline,
    and nothing before it begins; until somebody sets the parameter, who has taken over from then on.
    """
    if timeline is None:
        return parameter
    return parameter.skip(1).publish(lambda settings: rx.merge(timeline.take_until(settings), settings))
