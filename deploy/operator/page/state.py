"""What the pages show: from the topics of an arm to a state."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any, NamedTuple

import reactivex as rx
from reactivex import Observable

from deploy.operator.engines import BY_COMMAND, BY_PAGE, BY_WATCHDOG, OLDER, TOGETHER, Engines, Graph
from deploy.operator.hold import Hold
from deploy.supervision import manifest
from deploy.supervision.sentinel import reported
from interfaces import topics
from interfaces.service.health import healths
from interfaces.topics import ALIVE, INCAPACITATED, MISSED, TURN_OFF
from reactive_node import stamps
from reactive_node.stamps import Timestamp
from services import engine_controller, operator_watchdog

PROGRAMS = tuple(program.name for program in manifest.everywhere())
ENGINE_CONTROLLER = "engine_controller"
ECHO = 0.15  # s after a beat of a page for which a heartbeat on the topic is taken for that beat
SAMPLE_PERIOD = 1 / 30  # s between two samples of the trace
BEAT = "beat"  # the request of a page that is held
MAX_SAMPLES, MAX_LINES = 1800, 400  # those of a minute, for a page that opens later
MAX_REFUSALS = 20  # that are kept for a page that is slow

_REFUSED = re.compile(r"turn_on refused: ([^;]*)")

Seen = Callable[[topics.Topic], Observable[Timestamp[Any]]]
"""Gives the messages of a topic with their source times."""


class Clock(NamedTuple):
    """The times by which a page is drawn."""

    now: Callable[[], float]
    """The clock of the nonces [s]."""
    age: Callable[[datetime], float]
    """The age of a stamp [s]."""
    elapsed: Callable[[], float]
    """The time since the origin of the scenario [s]."""


class Program(NamedTuple):
    """A program on a host, as the sentinel sees its process and as it reports its health."""

    state: str = ""
    pid: int = 0
    restarts: int = 0
    observed: float = -math.inf
    """When the sentinel has published this [s]."""
    heard: float = -math.inf
    """When the program has reported its health [s]."""
    ok: bool = False
    reason: str = ""
    since_output: float | None = None
    """The age of its last output at that time [s]."""


class Recent(NamedTuple):
    """The last items of a sequence, for pages that each have seen a part of it."""

    items: tuple[Any, ...] = ()
    total: int = 0
    """The number of all items."""

    def add(self, items: Iterable[Any], most: int) -> Recent:
        """Add items; keep only the last `most`."""
        new = tuple(items)
        return Recent((*self.items, *new)[-most:], self.total + len(new))

    def forget(self) -> Recent:
        return Recent((), self.total)

    def since(self, count: int) -> tuple[Any, ...]:
        """Return what is kept of the items after the first ``count``."""
        new = self.total - count
        return self.items[-new:] if new else ()


class Arm(NamedTuple):
    configuration: Mapping[str, float] = {}
    position: tuple[float, float] | None = None
    speed: float | None = None
    samples: Recent = Recent()
    """The trace: time since the origin of the scenario [s], x, y and speed."""
    sampled: float = -math.inf


class Operator(NamedTuple):
    seen: float = -math.inf
    """When the operator was seen."""
    activity: str | None = None
    strikes_left: int | None = None


class Hands(NamedTuple):
    hold: Hold = Hold()
    """The page that holds it."""
    beaten: float = -math.inf
    """When the last beat of a page counted; a release does not change it."""
    heartbeat: float = -math.inf
    """When a heartbeat came that is not of a page."""
    pressed: bool = False
    """Whether the virtual switch was pressed by hand."""
    at_terminal: bool = False
    """Whether a hand at a terminal sends heartbeats."""


class PageState(NamedTuple):
    """All that a page may show; times are those of :attr:`Clock.now` [s]."""

    strikes: int = operator_watchdog.DEFAULTS.strikes
    """The strike that turns the engines off."""
    max_presence_age: float = engine_controller.DEFAULTS.max_presence_age
    """How long ago the operator may have been seen to count as seen [s]."""
    arm: Arm = Arm()
    by_hand: frozenset[str] = frozenset()
    """The sources of the configuration that were set by hand."""
    operator: Operator = Operator()
    hands: Hands = Hands()
    engines: Engines = Engines()
    programs: Mapping[tuple[str, str], Program] = {}
    """By host and name."""
    heard_since: float = -math.inf
    """Since when the programs are heard."""
    loopback_is_up: bool = True
    lines: Recent = Recent()
    """The lines of the terminal."""
    refusals: Recent = Recent()
    """Page, request and reason of each request that was refused."""


Change = Callable[[PageState], PageState]


def page_states(changes: Observable[Change], initial: PageState) -> Observable[PageState]:
    return changes.scan(lambda state, change: change(state), initial)


def always(
    seen: Seen,
    engines: Observable[Timestamp[str]],
    watchdogs: Observable[bool],
    graph: Graph,
    clock: Clock,
) -> Observable[Change]:
    """The changes that count even while no page is open: a page that opens later shows strikes and reasons.

    :param engines: the states of the engines.
    :param watchdogs: emits for each operator watchdog that appears, whether its strikes are known to begin.
    """
    return rx.merge(
        watchdogs.map(lambda begins: lambda state: _new_watchdog(state, begins)),
        _changes(seen(topics.OPERATOR_ACTIVITY), _activity, clock),
        _changes(seen(topics.ENGINES), _command(graph), clock),
        _changes(engines, _engines(graph), clock),
    )


def while_open(seen: Seen, lines: Observable[Any], namespace: str, clock: Clock) -> Observable[Change]:
    """The changes that count while a page is open; what was known before is out of date.

    :param lines: the batches of lines that the terminal shows.
    :param namespace: that of the arm; ``/diagnostics`` carries the health of all arms.
    """
    return rx.merge(
        rx.of(lambda state: _forget(state, clock.now())),
        *(_changes(seen(topic), _configuration(name), clock) for name, topic in topics.CONFIGURATION.items()),
        _changes(seen(topics.EFFECTOR_POSITION), _position, clock),
        _changes(seen(topics.EFFECTOR_TWIST), _speed, clock),
        _changes(seen(topics.OPERATOR_HEARTBEAT), _heartbeat, clock),
        _changes(seen(topics.OPERATOR_PRESENCE), _presence, clock),
        _changes(seen(topics.DIAGNOSTICS), _diagnostics(namespace.rstrip("/")), clock),
        lines.map(lambda batch: lambda state: _lines(state, batch, clock)),
    )


def _changes(
    messages: Observable[Timestamp[Any]], change: Callable[[PageState, Any, Clock], PageState], clock: Clock
) -> Observable[Change]:
    return messages.map(lambda message: lambda state: change(state, message, clock))


def _forget(state: PageState, now: float) -> PageState:
    return state._replace(
        heard_since=now,
        arm=Arm(samples=state.arm.samples.forget()),
        operator=state.operator._replace(seen=-math.inf),
        hands=state.hands._replace(heartbeat=-math.inf),
        engines=state.engines._replace(refused=None),
        programs={},
        lines=state.lines.forget(),
    )


# The arm


def _configuration(name: str) -> Callable[[PageState, Any, Clock], PageState]:
    def change(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
        configuration = {**state.arm.configuration, name: message.value}
        return state._replace(arm=state.arm._replace(configuration=configuration))

    return change


def _position(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
    stamp, x, y, _ = message.value
    arm, now = state.arm._replace(position=(x, y)), clock.now()
    if now - arm.sampled >= SAMPLE_PERIOD:
        at = clock.elapsed() - clock.age(stamps.from_nanoseconds(stamp))
        samples = arm.samples.add([(round(at, 3), x, y, arm.speed)], MAX_SAMPLES)
        arm = arm._replace(samples=samples, sampled=now)
    return state._replace(arm=arm)


def _speed(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
    return state._replace(arm=state.arm._replace(speed=message.value.speed))


# The operator


def _heartbeat(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
    now = clock.now()
    is_of_page = now - state.hands.beaten < ECHO
    return state if is_of_page else state._replace(hands=state.hands._replace(heartbeat=now))


def _presence(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
    seen = clock.now() - max(clock.age(message.value), 0.0)
    return state._replace(operator=state.operator._replace(seen=seen))


def _new_watchdog(state: PageState, begins: bool) -> PageState:
    left = state.strikes if begins else None
    return state._replace(operator=state.operator._replace(activity=None, strikes_left=left))


def _activity(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
    activity, (seen, before, left) = message.value, state.operator
    if activity == MISSED and left is not None:
        left = max(0, left - 1)
    elif activity == INCAPACITATED:
        left = 0
    elif activity == ALIVE and before == INCAPACITATED:
        left = state.strikes
    state = state._replace(operator=Operator(seen, activity, left))
    return _explain(state, BY_WATCHDOG, clock) if activity == INCAPACITATED else state


# The engines


def _command(graph: Graph) -> Callable[[PageState, Any, Clock], PageState]:
    def change(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
        if message.value != TURN_OFF:
            return state
        if clock.now() - state.engines.own_turn_off < TOGETHER:
            return _explain(state, BY_PAGE, clock)
        operator = state.operator
        if operator.activity is None and state.engines.since_when == OLDER:
            # A watchdog that is older than this process repeats the command of an earlier conclusion.
            operator = operator._replace(activity=INCAPACITATED, strikes_left=0)
        cause = BY_WATCHDOG if operator.activity == INCAPACITATED else BY_COMMAND
        after = _explain(state._replace(operator=operator), cause, clock)
        if cause == BY_COMMAND and after.engines is not state.engines:
            after = after._replace(engines=after.engines._replace(strangers=tuple(sorted(graph.strangers()))))
        return after

    return change


def _explain(state: PageState, cause: str, clock: Clock) -> PageState:
    return state._replace(engines=state.engines.explain(cause, clock.now()))


def _engines(graph: Graph) -> Callable[[PageState, Any, Clock], PageState]:
    def change(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
        before = state.engines
        engines = before.report(message.value, clock.now(), graph.controllers)
        if engines.off_since != before.off_since:
            engines = engines._replace(off_at=round(clock.elapsed(), 1))
        return state._replace(engines=engines)

    return change


# The processes


def _diagnostics(namespace: str) -> Callable[[PageState, Any, Clock], PageState]:
    def change(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
        programs, now, engines = dict(state.programs), clock.now(), state.engines
        for name, health in healths(message.value, namespace).items():
            if name in PROGRAMS:
                programs[health.host, name] = programs.get((health.host, name), Program())._replace(
                    heard=now, ok=health.ok, reason=health.reason, since_output=health.since_output
                )
            if health.since_turn_off is not None:
                engines = engines.name(name, now - health.since_turn_off)
            if name == ENGINE_CONTROLLER and (refusal := _REFUSED.search(health.reason)):
                engines = engines._replace(refused=(now, refusal[1].strip()))
        for process in reported(message.value, namespace):
            if process.name in PROGRAMS:
                key = process.host, process.name
                programs[key] = programs.get(key, Program())._replace(
                    state=process.state, pid=process.pid, restarts=process.restarts, observed=now
                )
        return state._replace(programs=programs, engines=engines)

    return change


def _lines(state: PageState, batch: Sequence[Any], clock: Clock) -> PageState:
    new = [
        {
            "time": round(1000 * (clock.elapsed() - clock.age(line.time))),
            "kind": line.kind.name.lower(),
            "text": line.text,
        }
        for line in batch
    ]
    return state._replace(lines=state.lines.add(new, MAX_LINES))


# What the wiring notes


def held(hold: Hold) -> Change:
    """The switch after an event of a page."""

    def change(state: PageState) -> PageState:
        beaten = max(state.hands.beaten, hold.seen)
        state = state._replace(hands=state.hands._replace(hold=hold, beaten=beaten))
        if hold.ended:
            page, why = hold.ended
            return refuse(page, BEAT, why)(state)
        return refuse(hold.refused[0], "press", hold.refused[1])(state) if hold.refused else state

    return change


def refuse(page: str, request: str, reason: str) -> Change:
    refusal = (page, request, reason)
    return lambda state: state._replace(refusals=state.refusals.add([refusal], MAX_REFUSALS))


def turned_off(now: float) -> Change:
    return lambda state: state._replace(engines=state.engines._replace(own_turn_off=now))


def pressed(pressed: bool) -> Change:
    """The virtual switch is pressed or released by hand."""
    return lambda state: state._replace(hands=state.hands._replace(pressed=pressed))


def held_at_terminal(at_terminal: bool) -> Change:
    """A hand at a terminal begins or ends to send heartbeats."""
    return lambda state: state._replace(hands=state.hands._replace(at_terminal=at_terminal))


def connected(loopback_is_up: bool) -> Change:
    """The loopback interface goes up or down."""
    return lambda state: state._replace(loopback_is_up=loopback_is_up)


def follows_scenario(name: str, follows: bool) -> Change:
    """A source of the configuration follows the scenario, or was set by hand."""
    return lambda state: state._replace(by_hand=state.by_hand - {name} if follows else state.by_hand | {name})
