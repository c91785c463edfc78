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
"""Gives the messages of a topic, each as a Timestamp with the time at which it was sent."""

MISSED_AFTER = 3.0  # s, as the operator watchdog
AWAY_AFTER = 1.5  # s: three of the watchdog's samples
SORTED_WITHIN = 0.02  # s by which one message may overtake another on its way
KINDS = ("data", "position", "speed", "signal", "alive", "missed", "asleep", "engines", "service")
BURST = defaultdict(lambda: 6.0, signal=12.0)  # lines of a kind shown in a row: Listing 5.9 has room in it
RATE = 1.0  # lines of a kind per second thereafter


class Line(NamedTuple):
    """A line for the operator; by kind lines are thinned, and those of one time are ordered."""

    time: datetime
    kind: str
    text: str


def view(seen: Seen, begin: float = 0.0, namespace: str = "/") -> Observable[Line]:
    """All lines of the arm in a namespace; the operator is expected from `begin` [s from now] on."""
    return rx.merge(measurements(seen), operator(seen, begin), engines(seen), services(seen, namespace)).pipe(
        ops.publish(in_order), ops.filter(Allowance().covers)
    )


def measurements(seen: Seen) -> Observable[Line]:
    """New configurations, positions and speeds."""
    configuration = rx.combine_latest(*(seen(topic) for topic in topics.CONFIGURATION.values()))
    return rx.merge(
        configuration.pipe(ops.map(_new_data)),
        seen(topics.EFFECTOR_POSITION).pipe(
            _line("position", lambda m: f"Position x: {m.point.x:g} and y: {m.point.y:g}")
        ),
        seen(topics.EFFECTOR_SPEED).pipe(_line("speed", lambda m: f"Speed: {m.data:g} [m/s]")),
    )


def operator(seen: Seen, begin: float) -> Observable[Line]:
    """The operator's signals, and that he is alive, missed, asleep."""
    presence = seen(topics.OPERATOR_PRESENCE).pipe(ops.share())
    last_seen = rx.merge(rx.timer(begin), presence).pipe(ops.share())
    turn_off = seen(topics.ENGINES).pipe(_of(topics.TURN_OFF))
    # The watchdog repeats its command while he is away: the first one counts.
    asleep = last_seen.pipe(
        ops.map(lambda _: rx.timer(AWAY_AFTER).pipe(ops.flat_map(lambda _: turn_off), ops.take(1))),
        ops.switch_latest(),
        ops.map(lambda _: None),
        ops.timestamp(),  # as the silences, which are noticed here
        ops.share(),
    )
    silences = rx.merge(
        last_seen.pipe(ops.map(lambda _: rx.interval(MISSED_AFTER))),
        asleep.pipe(ops.map(lambda _: rx.never())),
    ).pipe(ops.switch_latest(), ops.timestamp())
    # The command comes with the last silence: whichever is noticed first, it is one line.
    missed = rx.merge(silences, asleep).pipe(ops.throttle_first(AWAY_AFTER))
    commanded = last_seen.pipe(
        ops.map(lambda _: turn_off.pipe(ops.take_until(rx.timer(AWAY_AFTER)))), ops.switch_latest()
    )
    return rx.merge(
        seen(topics.OPERATOR_HEARTBEAT).pipe(
            _of(True), _line("signal", lambda _: "### Received signal from operator")
        ),
        presence.pipe(_line("alive", lambda _: "Operator is alive")),
        missed.pipe(_line("missed", lambda _: "Not received signal from operator...")),
        asleep.pipe(_line("asleep", lambda _: "Operator is sleeping !!!")),
        rx.merge(asleep, commanded).pipe(_line("engines", lambda _: "Turning off engines...")),
    )


def engines(seen: Seen) -> Observable[Line]:
    """Commands to turn the engines on, and whether they are on."""
    return rx.merge(
        seen(topics.ENGINES).pipe(_of(topics.TURN_ON), _line("engines", lambda _: "Turning on engines...")),
        seen(topics.ENGINES_STATE).pipe(
            ops.distinct_until_changed(_data),
            _line("engines", lambda state: f"Engines are {state.data}"),
        ),
    )


def services(seen: Seen, namespace: str) -> Observable[Line]:
    """What services have to complain about; /diagnostics tells of other arms, too."""
    complaints: dict[str, str] = {}

    def news(diagnostics: Any) -> Observable[Line]:
        lines = []
        for status in diagnostics.value.status:
            path, _, service = status.name.rpartition("/")
            if path != namespace.rstrip("/"):
                continue
            complaint = "" if status.level == type(status).OK else status.message
            if complaint and complaint != complaints.get(status.name):
                lines.append(Line(diagnostics.timestamp, "service", f"{service}: {complaint}"))
            complaints[status.name] = complaint
        return rx.from_iterable(lines)

    return seen(topics.DIAGNOSTICS).pipe(ops.flat_map(news))


def in_order(lines: Observable[Line]) -> Observable[Line]:
    """Emit the lines of a hot observable in the order of their times."""

    def by_time(lines: list[Line]) -> list[Line]:
        return sorted(lines, key=lambda line: (line.time, KINDS.index(line.kind)))

    full = lines.pipe(ops.throttle_first(SORTED_WITHIN), ops.flat_map(lambda _: rx.timer(SORTED_WITHIN)))
    return lines.pipe(ops.buffer(full), ops.flat_map(by_time))


class Allowance:
    """How many lines of each kind may be shown now: it grows by RATE a second, up to BURST."""

    def __init__(self) -> None:
        self._left = BURST.copy()
        self._since: dict[str, datetime] = {}

    def covers(self, line: Line) -> bool:
        """Whether a line may be shown; lines that come too fast to be read are not."""
        kind = line.kind
        passed = (line.time - self._since.get(kind, line.time)).total_seconds()
        self._since[kind] = line.time
        self._left[kind] = min(BURST[kind], self._left[kind] + passed * RATE)
        if self._left[kind] < 1:
            return False
        self._left[kind] -= 1
        return True


def _new_data(configuration: Any) -> Line:
    values = ", ".join(f"{item.value.data:g}" for item in configuration)
    return Line(max(item.timestamp for item in configuration), "data", f"### Received new data: {{{values}}}")


def _data(item: Any) -> Any:
    return item.value.data


def _of(data: object) -> Callable[[Observable[Any]], Observable[Any]]:
    return ops.filter(lambda item: _data(item) == data)


def _line(kind: str, text: Callable[[Any], str]) -> Callable[[Observable[Any]], Observable[Line]]:
    return ops.map(lambda item: Line(item.timestamp, kind, text(item.value)))
