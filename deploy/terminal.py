"""What the operator's terminal shows, as recipes: the lines of thesis Listing 5.9, seen on the topics.

What no topic tells is concluded as the operator watchdog concludes it: an operator who was not seen for 3 s
is missed, and a `turn_off` while he is away means that he is asleep.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from datetime import datetime
from typing import Any, NamedTuple

import reactivex as rx
from reactivex import Observable
from reactivex import operators as ops

from interfaces import topics

Seen = Callable[[topics.Topic], Observable[Any]]
"""Gives the messages of a topic."""

MISSED_AFTER = 3.0  # s, as the operator watchdog
AWAY_AFTER = 1.5  # s: three of the watchdog's samples
BURST = defaultdict(lambda: 6.0, signal=12.0)  # lines of a kind shown in a row: Listing 5.9 has room in it
RATE = 1.0  # lines of a kind per second thereafter


class Line(NamedTuple):
    """One line for the operator; lines of one kind are thinned together."""

    kind: str
    text: str


def view(seen: Seen, begin: float = 0.0) -> Observable[Line]:
    """All lines; the operator is expected from `begin` [s from now] on."""
    return rx.merge(measurements(seen), operator(seen, begin), engines(seen), services(seen))


def measurements(seen: Seen) -> Observable[Line]:
    """New configurations, positions and speeds."""
    configuration = [seen(topic).pipe(ops.map(_data)) for topic in topics.CONFIGURATION.values()]
    return rx.merge(
        rx.combine_latest(*configuration).pipe(
            _line("data", lambda values: f"### Received new data: {{{', '.join(f'{v:g}' for v in values)}}}")
        ),
        seen(topics.EFFECTOR_POSITION).pipe(
            _line("position", lambda m: f"Position x: {m.point.x:g} and y: {m.point.y:g}")
        ),
        seen(topics.EFFECTOR_SPEED).pipe(_line("speed", lambda m: f"Speed: {m.data:g} [m/s]")),
    )


def operator(seen: Seen, begin: float) -> Observable[Line]:
    """The operator's signals, and that he is alive, missed, asleep."""
    presence = seen(topics.OPERATOR_PRESENCE).pipe(ops.share())
    last_seen = rx.merge(rx.timer(begin), presence).pipe(ops.share())
    turn_off = seen(topics.ENGINES).pipe(
        ops.map(_data), ops.filter(lambda command: command == topics.TURN_OFF)
    )
    # The watchdog repeats its command while he is away: the first one counts.
    asleep = last_seen.pipe(
        ops.map(lambda _: rx.timer(AWAY_AFTER).pipe(ops.flat_map(lambda _: turn_off), ops.take(1))),
        ops.switch_latest(),
        ops.share(),
    )
    silences = rx.merge(
        last_seen.pipe(ops.map(lambda _: rx.interval(MISSED_AFTER))),
        asleep.pipe(ops.map(lambda _: rx.never())),
    ).pipe(ops.switch_latest())
    # The command comes with the last silence; whichever is noticed first, it is one line and stands in front.
    missed = rx.merge(silences, asleep).pipe(ops.throttle_first(AWAY_AFTER))
    return rx.merge(
        seen(topics.OPERATOR_HEARTBEAT).pipe(
            ops.filter(_data), _line("signal", lambda _: "### Received signal from operator")
        ),
        presence.pipe(_line("alive", lambda _: "Operator is alive")),
        missed.pipe(_line("missed", lambda _: "Not received signal from operator...")),
        asleep.pipe(_line("asleep", lambda _: "Operator is sleeping !!!")),
        asleep.pipe(_line("engines", lambda _: "Turning off engines...")),
    )


def engines(seen: Seen) -> Observable[Line]:
    """Commands to turn the engines on, and whether they are on."""
    return rx.merge(
        seen(topics.ENGINES).pipe(
            ops.map(_data),
            ops.filter(lambda command: command == topics.TURN_ON),
            _line("engines", lambda _: "Turning on engines..."),
        ),
        seen(topics.ENGINES_STATE).pipe(
            ops.map(_data),
            ops.distinct_until_changed(),
            _line("engines", lambda state: f"Engines are {state}"),
        ),
    )


def services(seen: Seen) -> Observable[Line]:
    """What services have to complain about."""

    def complaint(status: Any) -> str:
        service = status.name.rpartition("/")[2]
        return "" if status.level == type(status).OK else f"{service}: {status.message}"

    def complaints(statuses: Observable[Any]) -> Observable[Any]:
        return statuses.pipe(ops.map(complaint), ops.distinct_until_changed(), ops.filter(bool))

    def statuses(message: Any) -> Observable[Any]:
        return rx.from_iterable(message.status)

    def name(status: Any) -> str:
        return str(status.name)

    each: Any = ops.flat_map(statuses)
    by_service: Any = ops.group_by(name)
    return seen(topics.DIAGNOSTICS).pipe(each, by_service, ops.flat_map(complaints), _line("service", str))


def thinned(lines: Observable[Line]) -> Observable[Line]:
    """Leave lines of a kind out where they come too fast to be read."""
    return rx.defer(
        lambda _: lines.pipe(
            ops.timestamp(),
            ops.filter(_Allowance().covers),
            ops.map(_value),
        )
    )


class _Allowance:
    """How many lines of each kind may be shown now: it grows by RATE a second, up to BURST."""

    def __init__(self) -> None:
        self._left = BURST.copy()
        self._at: dict[str, datetime] = {}

    def covers(self, item: Any) -> bool:
        """Whether this line (a Timestamp) may be shown."""
        kind = item.value.kind
        passed = (item.timestamp - self._at.get(kind, item.timestamp)).total_seconds()
        self._at[kind] = item.timestamp
        self._left[kind] = min(BURST[kind], self._left[kind] + passed * RATE)
        if self._left[kind] < 1:
            return False
        self._left[kind] -= 1
        return True


def _line(kind: str, text: Callable[[Any], str]) -> Callable[[Observable[Any]], Observable[Line]]:
    return ops.map(lambda item: Line(kind, text(item)))


def _data(message: Any) -> Any:
    return message.data


def _value(item: Any) -> Any:
    return item.value
