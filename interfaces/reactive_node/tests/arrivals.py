"""Samples that arrive late and out of order, in virtual time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from hypothesis import strategies as st
from reactivex import Observable

from reactive_node.signals import Answer, Signal
from reactive_node.stamps import stamped
from reactive_node.testing import VirtualTime

MS = 1_000_000  # ns
SECOND = 1_000_000_000  # ns
LATENESS = 0.1  # s


class Arrival(NamedTuple):
    time: int  # ns
    value: Any
    delay: int  # ns


FLOATS = st.floats(-100, 100)


def arrivals(
    values: st.SearchStrategy[Any] = FLOATS, most: int = 100, size: int = 12
) -> st.SearchStrategy[list[Arrival]]:
    """Return lists of samples within the first second, in the order of time, each at most so late [ms]."""
    times = st.lists(st.integers(1, 1000), unique=True, max_size=size).map(sorted)
    delays = st.integers(0, most - 1)
    return times.flatmap(
        lambda times: st.tuples(*(st.tuples(st.just(time), values, delays) for time in times)).map(
            lambda items: [Arrival(time * MS, value, delay * MS) for time, value, delay in items]
        )
    )


def arriving(scheduler: VirtualTime, samples: Sequence[Arrival]) -> Any:
    inputs = [((time + delay) / SECOND, stamped(value, time)) for time, value, delay in samples]
    return scheduler.hot(*sorted(inputs, key=lambda item: item[0]))


def answers(
    scheduler: VirtualTime, signal: Signal[Any], period: float = 0.017, until: float = 1.5
) -> list[Answer[Any]]:
    return items(scheduler, signal.sample(period), until)


def items(scheduler: VirtualTime, observable: Observable[Any], until: float = 1.5) -> list[Any]:
    return [item for _, item in scheduler.record(observable, until=until).items]
