"""The recipes of the operator's terminal: from the topics of an arm to the lines of thesis Listing 5.9."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from enum import IntEnum, auto
from typing import Any, NamedTuple

import reactivex as rx
from reactivex import Observable

from deploy.operator import engines
from deploy.supervision.sentinel import reported
from interfaces import topics
from interfaces.service.clocks import difference
from interfaces.service.clocks import reported as reported_clocks
from interfaces.service.health import healths
from reactive_node.stamps import Timestamp

Seen = Callable[[topics.Topic], Observable[Timestamp[Any]]]
"""Gives the values of a topic with their source times."""
Span = tuple[datetime, datetime]
"""The times just before and just after a command was published."""

BURST = 6  # lines of a kind in a row before they are thinned
DISCOVERY = 1.0  # s within which a drive is heard, if there is one
SIGNAL_BURST = 12  # Listing 5.9 has 11 signals
FIRST, LAST = datetime.min.replace(tzinfo=UTC), datetime.max.replace(tzinfo=UTC)
NEVER = (LAST, FIRST)
TURNING_OFF = "Turning off engines..."
TOGETHER, REPORTED = (timedelta(seconds=each) for each in (engines.TOGETHER, engines.REPORTED))
ENGINES_ON, ENGINES_OFF = f"Engines are {topics.ON}", f"Engines are {topics.OFF}"


class Kind(IntEnum):
    """What a line is about, in the order of lines with the same time."""

    DATA = auto()
    POSITION = auto()
    SPEED = auto()
    SIGNAL = auto()
    ALIVE = auto()
    MISSED = auto()
    ASLEEP = auto()
    ENGINES = auto()
    OWN_TURN_OFF = auto()
    OTHERS_TURN_OFF = auto()
    STATE = auto()
    SENDER = auto()
    SERVICE = auto()
    PROCESS = auto()
    HAND = auto()


class Line(NamedTuple):
    """A line for the operator; lines sort by time, then kind."""

    time: datetime
    kind: Kind
    text: str


class Batch(NamedTuple):
    is_asleep: bool | None
    """Whether the operator sleeps, as far as it is known."""
    lines: list[Line]
    is_on: bool = False
    """Whether the engines are on."""
    turned_off: datetime = FIRST
    """The time of the last command `turn_off`."""
    told: datetime = FIRST
    """The time of the last one whose sender was told with it: the own node, or the watchdog."""
    went_off: datetime = FIRST
    """When the engines went off, until it is told who sent that command."""


class Complaints(NamedTuple):
    known: dict[tuple[str, str], str]
    """By host and name of the service; empty if it does not complain."""
    new: Timestamp[str]
    """What was new in the latest message of ``/diagnostics``."""


class Lives(NamedTuple):
    """The lives of processes, by host and program."""

    told: dict[tuple[str, str], int]
    """The restarts that were told."""
    died: dict[tuple[str, str], tuple[int, datetime]]
    """The pid of the process, and when the one before it died."""
    back: dict[tuple[str, str], tuple[int, datetime]]
    """The pid of the process, and when it first told its health."""
    new: list[Line]
    """What was new in the latest message of ``/diagnostics``."""


class Differences(NamedTuple):
    """The clocks of other hosts."""

    told: dict[str, int]
    """By host, whether its clock was told to be right (0), behind (1) or ahead (-1)."""
    new: list[Line]
    """What was new in the latest message of ``/diagnostics``."""


def line_batches(
    seen: Seen,
    own_turn_offs: Observable[Span],
    ticks: Observable[Any],
    graph: engines.Graph,
    namespace: str = "/",
    *,
    attached: bool = False,
) -> Observable[list[Line]]:
    """Emit the lines of an arm, at each tick those since the last one in the order of their times, if any.

    :param own_turn_offs: when this terminal has turned off the engines.
    :param namespace: that of the arm; ``/diagnostics`` carries the health of all arms.
    :param attached: whether this terminal begins later than the arm.
    """
    about_engines = rx.merge(commands(seen, own_turn_offs, graph), states(seen, graph))
    health = rx.merge(*(told(seen, namespace) for told in (services, deaths, senders, clocks)))
    lines = rx.merge(measurements(seen), operator(seen), about_engines, health)
    if attached:
        lines = rx.merge(lines, earlier(seen, namespace))
    batches: Observable[list[Line]] = lines.buffer(ticks).filter(bool)
    return batches.scan(next_batch, Batch(None, [])).map(lambda batch: batch.lines).filter(bool)


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
        thinned(activity.filter(_says(conclusion)))
        for conclusion in (topics.ALIVE, topics.MISSED, topics.INCAPACITATED)
    )
    return rx.merge(
        thinned(signals, SIGNAL_BURST).map(_line(Kind.SIGNAL, "### Received signal from operator")),
        alive.map(_line(Kind.ALIVE, "Operator is alive")),
        missed.map(_line(Kind.MISSED, "Not received signal from operator...")),
        asleep.map(_line(Kind.ASLEEP, "Operator is sleeping !!!")),
    )


def commands(seen: Seen, own_turn_offs: Observable[Span], graph: engines.Graph) -> Observable[Line]:
    """Commands to the engines from here and from other nodes, and the nodes without health that may have
    sent those: after the reports of the services, of which one may have done it.
    """
    all_ = seen(topics.ENGINES)
    own, others = (
        all_.filter(_says(topics.TURN_OFF))
        .with_latest_from(own_turn_offs.start_with(NEVER))
        .partition(_is_own)
    )
    others = thinned(others.map(_first)).share()

    def sender(command: Timestamp[Any]) -> Observable[Line]:
        names = " or ".join(sorted(graph.strangers()))
        line = Line(command.timestamp, Kind.SENDER, f"{names} turned off the engines")
        later = seen(topics.DIAGNOSTICS).filter(lambda it: it.timestamp - command.timestamp >= REPORTED)
        return later.take(1).map(lambda _: line) if names else rx.empty()

    return rx.merge(
        thinned(all_.filter(_says(topics.TURN_ON))).map(_line(Kind.ENGINES, "Turning on engines...")),
        own.map(_first).map(_line(Kind.OWN_TURN_OFF, "Turning off engines, as you asked...")),
        others.map(_line(Kind.OTHERS_TURN_OFF, "Turning off engines, as another node asked...")),
        others.flat_map(sender),
    )


def states(seen: Seen, graph: engines.Graph) -> Observable[Line]:
    """Whether the engines are on, and why they go off, if no command explains it."""

    def report(before: Timestamp[Any], state: Timestamp[str]) -> Timestamp[Any]:
        now = before.value.report(state.value, state.timestamp.timestamp(), graph.controllers)
        return Timestamp(now, state.timestamp)

    def words(now: engines.Engines) -> str:
        went_off = now.state == topics.OFF and now.off_since > -math.inf
        return f"Engines are {now.state}" + (f", {now.since_when}" if went_off else "")

    reports = seen(topics.ENGINES_STATE).scan(report, Timestamp(engines.Engines(), FIRST))
    return thinned(reports.distinct_until_changed(lambda it: it.value.state)).map(_line(Kind.STATE, words))


def services(seen: Seen, namespace: str) -> Observable[Line]:
    """The complaints of services, each when it is new."""

    def compare(before: Complaints, diagnostics: Timestamp[Any]) -> Complaints:
        now = dict(_complaints(diagnostics.value, namespace.rstrip("/")))
        new = [f"{key[1]}: {now[key]}" for key in now if now[key] and now[key] != before.known.get(key)]
        return Complaints(before.known | now, Timestamp("; ".join(new), diagnostics.timestamp))

    complaints = (
        seen(topics.DIAGNOSTICS).scan(compare, Complaints({}, Timestamp("", FIRST))).map(lambda it: it.new)
    )
    return thinned(complaints.filter(lambda it: it.value)).map(_line(Kind.SERVICE, str))


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


def senders(seen: Seen, namespace: str) -> Observable[Line]:
    """Each service that has sent a `turn_off`, by its own health."""

    def tell(diagnostics: Timestamp[Any]) -> Iterator[Line]:
        for sent, name in _turn_offs(diagnostics, namespace):
            yield Line(sent, Kind.SENDER, f"{name} turned off the engines")

    return seen(topics.DIAGNOSTICS).flat_map(lambda it: rx.from_iterable(tell(it)))


def earlier(seen: Seen, namespace: str) -> Observable[Line]:
    """What the services know of engines that are off already."""

    def gather(last: Timestamp[Any], diagnostics: Timestamp[Any]) -> Timestamp[Any]:
        turn_offs = (last.value, *_turn_offs(diagnostics, namespace))
        return Timestamp(max(turn_offs), diagnostics.timestamp)

    def tell(last: Timestamp[Any]) -> Line:
        sent, name = last.value
        age = (last.timestamp - sent).total_seconds()
        known = (
            f"{name} sent the last turn_off, {age:.1f} s ago" if name else "no service has sent a turn_off"
        )
        return Line(last.timestamp, Kind.SERVICE, f"Engines were off before this terminal began; {known}")

    def told(first: Timestamp[str]) -> Observable[Line]:
        last = seen(topics.DIAGNOSTICS).scan(gather, Timestamp((FIRST, ""), FIRST))
        return last.filter(lambda it: it.timestamp - first.timestamp >= REPORTED).take(1).map(tell)

    return seen(topics.ENGINES_STATE).take(1).filter(_says(topics.OFF)).flat_map(told)


def deaths(seen: Seen, namespace: str) -> Observable[Line]:
    """Each death of a process, when the next one has told its health: that is when it is back."""
    prefix = namespace.rstrip("/")

    def compare(before: Lives, diagnostics: Timestamp[Any]) -> Lives:
        told, died, back, new = dict(before.told), dict(before.died), dict(before.back), []
        for name, health in healths(diagnostics.value, prefix).items():
            if back.get((health.host, name), (0, FIRST))[0] != health.pid:
                back[health.host, name] = health.pid, diagnostics.timestamp
        for program in reported(diagnostics.value, prefix):
            key, pid = (program.host, program.name), program.pid
            if died.get(key, (0, FIRST))[0] != pid:  # by the first report, which is not repeated but new
                died[key] = pid, diagnostics.timestamp - timedelta(seconds=program.uptime + program.away)
            deaths = program.restarts - told.setdefault(key, program.restarts)
            if deaths < 0:  # a new supervisord begins to count again
                told[key] = program.restarts
            elif deaths and pid and back.get(key, (0, FIRST))[0] == pid:
                told[key], returned = program.restarts, back[key][1]
                how = f"died {deaths} times, last" if deaths > 1 else "died"
                away = (returned - died[key][1]).total_seconds()
                text = f"{program.name} {how} ({program.exit}), back after {away:.1f} s"
                new.append(Line(returned, Kind.PROCESS, text))
        return Lives(told, died, back, new)

    lives = seen(topics.DIAGNOSTICS).scan(compare, Lives({}, {}, {}, []))
    return lives.flat_map(lambda it: rx.from_iterable(it.new))


def clocks(seen: Seen, namespace: str) -> Observable[Line]:
    """By how much two clocks differ: when that is known, and when it begins or ends to matter."""

    def compare(before: Differences, diagnostics: Timestamp[Any]) -> Differences:
        told, new = dict(before.told), []
        for host, (behind, other) in reported_clocks(diagnostics.value, namespace.rstrip("/")).items():
            way = (behind > topics.CLOCK_TOLERANCE) - (behind < -topics.CLOCK_TOLERANCE)
            if told.get(host) != way:
                told[host] = way
                text = difference(host, behind, f"that of {other}")
                new.append(Line(diagnostics.timestamp, Kind.SERVICE, text))
        return Differences(told, new)

    differences = seen(topics.DIAGNOSTICS).scan(compare, Differences({}, []))
    return differences.flat_map(lambda it: rx.from_iterable(it.new))


def thinned(items: Observable[Timestamp[Any]], burst: int = BURST) -> Observable[Timestamp[Any]]:
    """Emit at most ``burst`` items in a row, then the first of each second; pauses refill the burst."""
    return items.filter(Allowance(burst).covers)


class Allowance:
    """How many items may be shown: one more with each second, up to ``burst``.

    Seconds are those of the clock: lines of different kinds appear together, of the same moment.
    """

    def __init__(self, burst: int) -> None:
        self._burst = burst
        self._left = burst
        self._second = 0

    def covers(self, item: Timestamp[Any]) -> bool:
        """Whether an item may be shown; it is counted then."""
        second = int(item.timestamp.timestamp())
        self._left = min(self._burst, self._left + max(0, second - self._second))
        self._second = second
        if not self._left:
            return False
        self._left -= 1
        return True


def next_batch(previous: Batch, lines: list[Line]) -> Batch:
    """Sort lines, tell why the engines go off, and show one command of the watchdog for each sleep."""
    is_asleep, _, is_on, turned_off, told, went_off = previous
    shown = []
    for line in sorted(lines):
        if line.kind in (Kind.ASLEEP, Kind.OWN_TURN_OFF, Kind.OTHERS_TURN_OFF):
            turned_off = line.time
        if line.kind in (Kind.ASLEEP, Kind.OWN_TURN_OFF):
            told = line.time
            went_off = FIRST if abs(told - went_off) <= TOGETHER else went_off
        match line.kind:
            case Kind.ALIVE | Kind.MISSED:
                is_asleep = False
            case Kind.ASLEEP:
                is_asleep = True
            case Kind.OTHERS_TURN_OFF if is_asleep:
                continue  # the watchdog repeats its command
            case Kind.OTHERS_TURN_OFF if is_asleep is None:  # it may do so since before this terminal began
                is_asleep, line = True, line._replace(text=TURNING_OFF)
            case Kind.STATE:
                was_on, is_on = is_on, line.text == ENGINES_ON
                went_off = line.time if was_on and not is_on and line.time - told > TOGETHER else went_off
                if not is_on and line.time - turned_off <= TOGETHER:
                    line = line._replace(text=ENGINES_OFF)
            case Kind.SENDER:
                if abs(line.time - went_off) > TOGETHER:
                    continue  # it sends again while they are off, has sent it long ago, or was told already
                went_off = FIRST
        shown.append(line)
        if line.kind is Kind.ASLEEP:
            shown.append(Line(line.time, Kind.ENGINES, TURNING_OFF))
    return Batch(is_asleep, shown, is_on, turned_off, told, went_off)


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


def _is_own(command: tuple[Timestamp[Any], Span]) -> bool:
    item, (before, after) = command
    return before <= item.timestamp <= after


def _first(pair: tuple[Timestamp[Any], Any]) -> Timestamp[Any]:
    return pair[0]


def _turn_offs(diagnostics: Timestamp[Any], namespace: str) -> Iterator[tuple[datetime, str]]:
    """Yield when each service has sent its last `turn_off`, and its name."""
    for name, health in healths(diagnostics.value, namespace.rstrip("/")).items():
        if health.since_turn_off is not None:
            yield diagnostics.timestamp - timedelta(seconds=health.since_turn_off), name


def _complaints(diagnostics: Any, namespace: str) -> Iterator[tuple[tuple[str, str], str]]:
    for status in diagnostics.status:
        path, _, service = status.name.rpartition("/")
        if path == namespace:
            yield (status.hardware_id, service), "" if status.level == type(status).OK else status.message
