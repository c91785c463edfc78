"""The permission to move that every drive needs: a young ``on`` (deploy/SAFETY.md, A1)."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import reactivex as rx
from reactivex import Observable
from reactivex.scheduler import ImmediateScheduler

from interfaces.service import ServiceNode
from interfaces.topics import DRIVE_TIMEOUT, ENGINES_STATE, OFF, ON
from reactive_node.sampled_reader import keep_last

UNREAD = 100
"""States that wait while the process is paused: an ``on`` must not replace another controller's ``off``."""
NEVER = datetime.min.replace(tzinfo=UTC)


class EngineState(NamedTuple):
    """A state of the engines as it arrived."""

    name: str
    at: datetime  # of the arrival, on the Rx clock, which is never set
    age: float  # of the source time at arrival [s]
    off: datetime = NEVER  # arrival of the last `off` before it

    @property
    def young_until(self) -> datetime:
        """Until when an ``on`` is accepted, on the Rx clock."""
        return self.at + timedelta(seconds=DRIVE_TIMEOUT - max(self.age, 0.0))


def unopposed(states: Observable[EngineState]) -> Observable[EngineState]:
    """Emit the states, but no ``on`` that comes within 400 ms of an ``off``.

    So, of two controllers, none moves a drive against the other.
    """

    def step(before: EngineState, state: EngineState) -> EngineState:
        return state._replace(off=before.at if before.name == OFF else before.off)

    def counts(state: EngineState) -> bool:
        return state.name == OFF or state.at >= state.off + timedelta(seconds=DRIVE_TIMEOUT)

    return states.scan(step).filter(counts)


def permissions(states: Observable[EngineState]) -> Observable[bool]:
    """Emit whether a drive may move: with each state, and ``False`` as soon as an ``on`` is no longer young.

    An unopposed ``on`` is accepted for 400 ms from its source time. It begins with ``False``, and ends
    with the states.
    """

    def is_young(state: EngineState) -> bool:
        return state.name == ON and state.age < DRIVE_TIMEOUT

    def end(state: EngineState) -> Observable[bool]:
        return rx.timer(state.young_until).map(lambda _: False) if is_young(state) else rx.never()

    def permitted(states: Observable[EngineState]) -> Observable[bool]:
        ends = states.switch_map(end).take_until(states.last_or_default(None))
        return rx.merge(rx.just(False, ImmediateScheduler.singleton()), states.map(is_young), ends)

    return unopposed(states).publish(permitted)


def engine_states(node: ServiceNode) -> Observable[EngineState]:
    """Return the states of the engines of the arm of a node."""
    every = replace(ENGINES_STATE, qos=keep_last(ENGINES_STATE.qos, UNREAD))
    # The arrival before the age: a pause in between must make a state older, not younger.
    states = node.observe(every, timestamped=True).timestamp()
    return states.map(lambda it: EngineState(it.value.value, it.timestamp, node.age(it.value.timestamp)))


def observe(node: ServiceNode) -> Observable[bool]:
    """Return the permissions of the arm of a node."""
    return permissions(engine_states(node))
