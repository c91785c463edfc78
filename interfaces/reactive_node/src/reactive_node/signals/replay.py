"""Samples of a record as a live signal took them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import reactivex as rx
from reactivex import Observable

from reactive_node.signals.answers import Refused
from reactive_node.stamps import Timestamp

T = TypeVar("T")


def as_taken(samples: Observable[Timestamp[T]], refused: Iterable[Refused]) -> Observable[Timestamp[T]]:
    """
    Return samples without those that were dropped, and with the times from which those count that were late.

    A signal of them gives the answers that the live signal gave, if they come within its bounds.

    :param refused: everything that the signal has passed to its argument ``refused``.
    """
    known = list(refused)

    def begin(_: object) -> Observable[Timestamp[T]]:
        left: dict[int, list[Refused]] = {}
        for each in known:
            left.setdefault(each.time, []).append(each)

        def taken(sample: Timestamp[T]) -> Timestamp[T] | None:
            for each in left.get(sample.nanoseconds, ()):
                if each.value == sample.value:
                    left[sample.nanoseconds].remove(each)
                    return None if each.taken is None else sample._replace(nanoseconds=each.taken)
            return sample

        return samples.map(taken).filter(lambda sample: sample is not None)

    return rx.defer(begin)
