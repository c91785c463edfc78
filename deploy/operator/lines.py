"""The recipes of the operator's terminal: from the topics of an arm to the lines of thesis Listing 5.9."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from enum import IntEnum, auto
from typing import Any, NamedTuple, TypeVar

import reactivex as rx
from reactivex import Observable

from deploy.operator.engines import WATCHDOG
from deploy.supervision.sentinel import reported
from interfaces import cause, topics
from interfaces.limits import newest
from interfaces.service.clocks import difference
from interfaces.service.clocks import reported as reported_clocks
from interfaces.service.health import healths
from reactive_node.stamps import Timestamp

Seen = Callable[[topics.Topic], Observable[Timestamp[Any]]]
"""Gives the values of a topic with their source times."""
Complaints = dict[tuple[str, str], str]
"""The complaint of each service, by host and name; empty if it does not complain."""
Ways = dict[str, int]
"""By host, whether its clock was shown to be right (0), behind (1) or ahead (-1)."""
Known = TypeVar("Known")

BURST = 6  # lines of a kind in a row before they are thinned
DISCOVERY = 1.0  # s within which a drive is heard, if there is one
SIGNAL_BURST = 12  # Listing 5.9 has 11 signals
FIRST = datetime.min.replace(tzinfo=UTC)


class Kind(IntEnum):
    """The kinds of lines, in the order of lines with the same time."""

    DATA = auto()
    POSITION = auto()
    SPEED = auto()
    SIGNAL = auto()
    ALIVE = auto()
    MISSED = auto()
    ASLEEP = auto()
    ENGINES = auto()
    TURN_OFF = auto()
    STATE = auto()
    SERVICE = auto()
    PROCESS = auto()
    HAND = auto()


class Line(NamedTuple):
    """A line for the operator; lines sort by time, then kind."""

    time: datetime
    kind: Kind
    text: str


class Lives(NamedTuple):
    """The lives of processes, by host and program."""

    shown: dict[tuple[str, str], int]
    """The restarts that were shown."""
    died: dict[tuple[str, str], tuple[int, datetime]]
    """The pid of the process, and when the one before it died."""
    back: dict[tuple[str, str], tuple[int, datetime]]
    """The pid of the process, and when it first reported its health."""


def line_batches(seen: Seen, ticks: Observable[Any], namespace: str = "/") -> Observable[list[Line]]:
    """Emit the lines of an arm, at each tick those since the last one in the order of their times, if any.

    :param namespace: that of the arm; ``/diagnostics`` carries the health of all arms.
    """
    health = rx.merge(*(found(seen, namespace) for found in (services, deaths, clocks)))
    lines = rx.merge(measurements(seen), operator(seen), commands(seen), states(seen), health)
    batches: Observable[list[Line]] = lines.buffer(ticks).filter(bool)
    return batches.map(sorted)


def measurements(seen: Seen) -> Observable[Line]:
    configuration = rx.combine_latest(*(seen(topic) for topic in topics.CONFIGURATION.values())).map(_joined)
    drive = seen(topics.DRIVEN_TIME).take(1).map(lambda _: True)
    is_driven = drive.timeout(DISCOVERY, drive.start_with(False))
    data = unrepeated(configuration, is_driven, lambda it: it)
    positions = unrepeated(seen(topics.EFFECTOR_POSITION), is_driven, lambda it: (it.x, it.y))
    return rx.merge(
        thinned(data).map(_line(Kind.DATA, lambda it: f"### Received new data: {{{_numbers(it)}}}")),
        thinned(positions).map(_line(Kind.POSITION, lambda it: f"Position x: {it.x:g} and y: {it.y:g}")),
        thinned(seen(topics.EFFECTOR_SPEED)).map(_line(Kind.SPEED, lambda it: f"Speed: {it:g} [m/s]")),
    )


def operator(seen: Seen) -> Observable[Line]:
    """The operator's signals, and what the operator watchdog concludes from them."""
    signals = seen(topics.OPERATOR_HEARTBEAT).filter(_says(True))
    activity = seen(topics.OPERATOR_ACTIVITY)
    alive, missed, asleep = (
        thinned(activity.filter(_says(conclusion))).share()
        for conclusion in (topics.ALIVE, topics.MISSED, topics.INCAPACITATED)
    )
    return rx.merge(
        thinned(signals, SIGNAL_BURST).map(_line(Kind.SIGNAL, "### Received signal from operator")),
        alive.map(_line(Kind.ALIVE, "Operator is alive")),
        missed.map(_line(Kind.MISSED, "Not received signal from operator...")),
        asleep.map(_line(Kind.ASLEEP, "Operator is sleeping !!!")),
        asleep.map(_line(Kind.ENGINES, "Turning off engines...")),
    )


def commands(seen: Seen) -> Observable[Line]:
    """Commands to the engines. Those of the watchdog follow from its conclusion, and it repeats them."""
    turn_ons = seen(topics.ENGINES).filter(_says(topics.TURN_ON))
    turn_offs = seen(topics.ENGINES_SENDER).filter(lambda it: it.value.command == topics.TURN_OFF)
    repeated, others = turn_offs.partition(lambda it: it.value.node == WATCHDOG)
    unexplained = repeated.take_until(seen(topics.OPERATOR_ACTIVITY)).take(1)  # it was there before us
    return rx.merge(
        thinned(turn_ons).map(_line(Kind.ENGINES, "Turning on engines...")),
        thinned(rx.merge(others, unexplained)).map(
            _line(Kind.TURN_OFF, lambda it: f"Turning off engines, as {it.node} asked...")
        ),
    )


def states(seen: Seen) -> Observable[Line]:
    """Whether the engines are on, and why they are off."""

    def line(message: Timestamp[Any]) -> Line:
        found = cause.read(message.value)
        why = f", {found.words}" if found.state == topics.OFF else ""
        begin = message.timestamp - timedelta(seconds=found.since)
        return Line(begin, Kind.STATE, f"Engines are {found.state}{why}")

    return _few(seen(topics.ENGINES_CAUSE).map(line).distinct_until_changed(lambda it: it.text))


def services(seen: Seen, namespace: str) -> Observable[Line]:
    """The complaints of services, each when it is new."""

    def compare(known: Complaints, diagnostics: Timestamp[Any]) -> tuple[Complaints, list[Line]]:
        now = dict(_complaints(diagnostics.value, namespace.rstrip("/")))
        new = [f"{key[1]}: {now[key]}" for key in now if now[key] and now[key] != known.get(key)]
        lines = [Line(diagnostics.timestamp, Kind.SERVICE, "; ".join(new))] if new else []
        return newest(known | now), lines

    nothing: Complaints = {}
    return _few(_news(seen, compare, nothing))


def unrepeated(
    items: Observable[Timestamp[Any]], is_driven: Observable[bool], key: Callable[[Any], Any]
) -> Observable[Timestamp[Any]]:
    """Emit only changes if a drive moves the joints: a joint that stands publishes its angle again and again.

    Without a drive, all are emitted: Listing 5.9 shows values that are published twice. Until it is known,
    there may be one.
    """

    def step(state: tuple[Any, bool], event: Any) -> tuple[Any, bool]:
        return (None, event) if isinstance(event, bool) else (event, state[1])

    def is_repeated(before: tuple[Any, bool], now: tuple[Any, bool]) -> bool:
        return now[1] and key(before[0].value) == key(now[0].value)

    states = rx.merge(is_driven, items).scan(step, (None, True)).filter(lambda state: state[0] is not None)
    return states.distinct_until_changed(comparer=is_repeated).map(_first)


def deaths(seen: Seen, namespace: str) -> Observable[Line]:
    """Each death of a process, when the next one has reported its health: that is when it is back."""
    prefix = namespace.rstrip("/")

    def compare(before: Lives, diagnostics: Timestamp[Any]) -> tuple[Lives, list[Line]]:
        shown, died, back, new = dict(before.shown), dict(before.died), dict(before.back), list[Line]()
        for name, health in healths(diagnostics.value, prefix).items():
            if back.get((health.host, name), (0, FIRST))[0] != health.pid:
                back[health.host, name] = health.pid, diagnostics.timestamp
        for program in reported(diagnostics.value, prefix):
            key, pid = (program.host, program.name), program.pid
            if died.get(key, (0, FIRST))[0] != pid:  # by the first report, which is not repeated but new
                died[key] = pid, diagnostics.timestamp - timedelta(seconds=program.uptime + program.away)
            deaths = program.restarts - shown.setdefault(key, program.restarts)
            if deaths < 0:  # a new supervisord begins to count again
                shown[key] = program.restarts
            elif deaths and pid and back.get(key, (0, FIRST))[0] == pid:
                shown[key], returned = program.restarts, back[key][1]
                how = f"died {deaths} times, last" if deaths > 1 else "died"
                away = (returned - died[key][1]).total_seconds()
                text = f"{program.name} {how} ({program.exit}), back after {away:.1f} s"
                new.append(Line(returned, Kind.PROCESS, text))
        return Lives(newest(shown), newest(died), newest(back)), new

    return _news(seen, compare, Lives({}, {}, {}))


def clocks(seen: Seen, namespace: str) -> Observable[Line]:
    """By how much two clocks differ: when that is known, and when it begins or ends to matter."""

    def compare(shown: Ways, diagnostics: Timestamp[Any]) -> tuple[Ways, list[Line]]:
        known, new = dict(shown), []
        for host, (behind, other) in reported_clocks(diagnostics.value, namespace.rstrip("/")).items():
            way = (behind > topics.CLOCK_TOLERANCE) - (behind < -topics.CLOCK_TOLERANCE)
            if known.get(host) != way:
                known[host] = way
                text = difference(host, behind, f"that of {other}")
                new.append(Line(diagnostics.timestamp, Kind.SERVICE, text))
        return newest(known), new

    nothing: Ways = {}
    return _news(seen, compare, nothing)


def _news(
    seen: Seen, compare: Callable[[Known, Timestamp[Any]], tuple[Known, list[Line]]], nothing: Known
) -> Observable[Line]:
    """Emit the lines with which each message of ``/diagnostics`` changes what is known."""
    states = seen(topics.DIAGNOSTICS).scan(lambda before, it: compare(before[0], it), (nothing, list[Line]()))
    # Most messages bring nothing new: for these, there is no inner observable.
    return states.filter(lambda it: bool(it[1])).flat_map(lambda it: rx.from_iterable(it[1]))


def thinned(items: Observable[Timestamp[Any]], burst: int = BURST) -> Observable[Timestamp[Any]]:
    """Emit at most ``burst`` items in a row, then the first of each second; pauses refill the burst."""
    allowance = Allowance(burst)
    return items.filter(lambda it: allowance.covers(it.timestamp))


def _few(lines: Observable[Line]) -> Observable[Line]:
    """Do the same with lines."""
    allowance = Allowance(BURST)
    return lines.filter(lambda it: allowance.covers(it.time))


class Allowance:
    """How many items may be shown: one more with each second, up to ``burst``.

    Seconds are those of the clock: lines of different kinds appear together, of the same moment.
    """

    def __init__(self, burst: int) -> None:
        self._burst = burst
        self._left = burst
        self._second = 0

    def covers(self, time: datetime) -> bool:
        """Whether an item of a time may be shown; it is counted then."""
        second = int(time.timestamp())
        self._left = min(self._burst, self._left + max(0, second - self._second))
        self._second = second
        if not self._left:
            return False
        self._left -= 1
        return True


def _line(kind: Kind, text: str | Callable[[Any], str]) -> Callable[[Timestamp[Any]], Line]:
    if isinstance(text, str):
        return lambda item: Line(item.timestamp, kind, text)
    return lambda item: Line(item.timestamp, kind, text(item.value))


def _joined(items: Sequence[Timestamp[Any]]) -> Timestamp[list[Any]]:
    return Timestamp([item.value for item in items], max(item.timestamp for item in items))


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def _says(value: object) -> Callable[[Timestamp[Any]], bool]:
    return lambda item: bool(item.value == value)


def _first(pair: tuple[Timestamp[Any], Any]) -> Timestamp[Any]:
    return pair[0]


def _complaints(diagnostics: Any, namespace: str) -> Iterator[tuple[tuple[str, str], str]]:
    for status in diagnostics.status:
        path, _, service = status.name.rpartition("/")
        if path == namespace:
            yield (status.hardware_id, service), "" if status.level == type(status).OK else status.message
