"""The state that the pages show, from the topics of an arm."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any, NamedTuple

import reactivex as rx
from reactivex import Observable

from deploy.operator.engines import WATCHDOG, Engines
from deploy.operator.hold import Hold
from deploy.operator.holder import Holder
from deploy.operator.strikes import Operator
from deploy.supervision import manifest
from deploy.supervision.sentinel import reported
from interfaces import cause, topics
from interfaces.limits import newest
from interfaces.service.health import healths
from interfaces.topics import INCAPACITATED, TURN_OFF
from reactive_node.stamps import Timestamp
from services import engine_controller, operator_watchdog

PROGRAMS = tuple(program.name for program in manifest.everywhere())
UNHEARD = 0.3  # s without news, after which a value is not known any more: the contract allows gaps of 0.25 s
SAMPLE_PERIOD = 1 / 30  # s between two samples of the trace
STILL_PERIOD = 0.1  # s, the same while the arm stands
BEAT = "beat"  # the request of a page that is held
MAX_SAMPLES, MAX_LINES = 1800, 400  # those of a minute, for a page that opens later
MAX_REFUSALS = 20  # that are kept for a page that is slow

Seen = Callable[[topics.Topic], Observable[Timestamp[Any]]]
"""Gives the messages of a topic with their source times."""


class Clock(NamedTuple):
    """The times by which a page is drawn."""

    now: Callable[[], float]
    """The clock of the nonces [s]."""
    age: Callable[[datetime], float]
    """The age of a source time [s]."""
    elapsed: Callable[[], float]
    """The time since the origin of the scenario [s]."""
    stamp_age: Callable[[int], float]
    """The age of the stamp of a header [ns], by ROS time [s]."""


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
    output: float | None = None
    """When its last output was, as time since the origin of the scenario [s]."""


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
    heard: Mapping[str, float] = {}
    """When each value of the configuration came."""
    position: tuple[float, float] | None = None
    positioned: float = -math.inf
    """When the position came."""
    speed: float | None = None
    sped: float = -math.inf
    """When the speed came: it is silent while a value of the configuration is not known."""
    samples: Recent = Recent()
    """The trace: time since the origin of the scenario [s], x, y, speed and the joints' angles."""
    sampled: float = -math.inf

    def fresh_speed(self, now: float) -> float | None:
        return self.speed if now - self.sped <= UNHEARD else None

    def unheard(self, now: float) -> list[str]:
        """Return the values of the configuration, and `position`, that are known no more at a time [s].

        A value that stands has no news, but the speed has. A position stands while the configuration does.
        """
        names = [name for name, heard in self.heard.items() if now - max(heard, self.sped) > UNHEARD]
        changed = max(self.heard.values(), default=-math.inf)
        is_behind = changed - self.positioned > UNHEARD and now - self.positioned > UNHEARD
        return [*names, *(["position"] if names or is_behind else [])]


class Hands(NamedTuple):
    hold: Hold = Hold()
    """The page that holds it."""
    holder: Holder = Holder()
    """The other holder of the switch."""


class PageState(NamedTuple):
    """All that a page may show; times are those of :attr:`Clock.now` [s]."""

    strikes: int = operator_watchdog.DEFAULTS.strikes
    """The strike that turns the engines off."""
    max_presence_age: float = engine_controller.DEFAULTS.max_presence_age
    """How long ago the operator may have been seen to count as seen [s]."""
    silence: float = operator_watchdog.DEFAULTS.silence
    """A silence of this length is a strike [s]."""
    presence_timeout: float = engine_controller.DEFAULTS.presence_timeout
    """How long after the operator was seen the controller turns the engines off [s]."""
    arm: Arm = Arm()
    by_hand: frozenset[str] = frozenset()
    """The sources of the configuration that were set by hand."""
    operator: Operator = Operator()
    hands: Hands = Hands()
    engines: Engines = Engines()
    programs: Mapping[tuple[str, str], Program] = {}
    """By host and name."""
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
    watchdogs: Observable[bool],
    clock: Clock,
) -> Observable[Change]:
    """The changes that count even while no page is open: a page that opens later shows strikes.

    :param watchdogs: emits for each operator watchdog that appears, whether its strikes are known to begin.
    """
    return rx.merge(
        watchdogs.map(lambda begins: lambda state: _new_watchdog(state, begins)),
        _changes(seen(topics.OPERATOR_ACTIVITY), _activity, clock),
        _changes(seen(topics.ENGINES_SENDER), _command, clock),
    )


def while_open(seen: Seen, lines: Observable[Any], namespace: str, clock: Clock) -> Observable[Change]:
    """The changes that count while a page is open; what was known before is out of date.

    :param lines: the batches of lines that the terminal shows.
    :param namespace: that of the arm; ``/diagnostics`` carries the health of all arms.
    """
    return rx.merge(
        rx.of(_forget),
        *(_changes(seen(topic), _configuration(name), clock) for name, topic in topics.CONFIGURATION.items()),
        _changes(seen(topics.EFFECTOR_POSITION), _position, clock),
        _changes(seen(topics.EFFECTOR_TWIST), _speed, clock),
        _changes(seen(topics.OPERATOR_HEARTBEAT), _heartbeat, clock),
        _changes(seen(topics.OPERATOR_HAND), _hand, clock),
        _changes(seen(topics.ENGINES_STATE), _engines, clock),
        _changes(seen(topics.ENGINES_CAUSE), _cause, clock),
        _changes(seen(topics.OPERATOR_PRESENCE), _presence, clock),
        _changes(seen(topics.DIAGNOSTICS), _diagnostics(namespace.rstrip("/")), clock),
        lines.map(lambda batch: lambda state: _lines(state, batch, clock)),
    )


def _changes(
    messages: Observable[Timestamp[Any]], change: Callable[[PageState, Any, Clock], PageState], clock: Clock
) -> Observable[Change]:
    return messages.map(lambda message: lambda state: change(state, message, clock))


def _forget(state: PageState) -> PageState:
    return state._replace(
        arm=Arm(samples=state.arm.samples.forget()),
        operator=state.operator._replace(seen=-math.inf),
        hands=Hands(state.hands.hold),
        engines=Engines(),
        programs={},
        lines=state.lines.forget(),
    )


# The arm


def _configuration(name: str) -> Callable[[PageState, Any, Clock], PageState]:
    def change(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
        configuration = {**state.arm.configuration, name: message.value}
        heard = {**state.arm.heard, name: clock.now()}
        return state._replace(arm=state.arm._replace(configuration=configuration, heard=heard))

    return change


def _position(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
    stamp, x, y, _ = message.value
    now = clock.now()
    arm = state.arm._replace(position=(x, y), positioned=now)
    if now - arm.sampled >= SAMPLE_PERIOD:
        arm = _sample(arm, clock.elapsed() - clock.stamp_age(stamp), now)
    return state._replace(arm=arm)


def _speed(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
    now = clock.now()
    arm = state.arm._replace(speed=message.value.speed, sped=now)
    if now - arm.sampled >= STILL_PERIOD:
        arm = _sample(arm, clock.elapsed(), now)
    return state._replace(arm=arm)


def _sample(arm: Arm, at: float, now: float) -> Arm:
    x, y = arm.position if arm.position and "position" not in arm.unheard(now) else (None, None)
    joints = (arm.configuration.get(name) for name in ("theta1", "theta2"))
    samples = arm.samples.add([(round(at, 3), x, y, arm.fresh_speed(now), *joints)], MAX_SAMPLES)
    return arm._replace(samples=samples, sampled=now)


# The operator


def _heartbeat(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
    return state._replace(hands=state.hands._replace(holder=state.hands.holder.beats(clock.now())))


def _hand(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
    holder = state.hands.holder.reports(message.value.frame_id, clock.now())
    return state._replace(hands=state.hands._replace(holder=holder))


def _presence(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
    seen = clock.now() - max(clock.age(message.value), 0.0)
    return state._replace(operator=state.operator._replace(seen=seen))


def _new_watchdog(state: PageState, begins: bool) -> PageState:
    return state._replace(operator=state.operator.begins_again(state.strikes if begins else None))


def _activity(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
    return state._replace(operator=state.operator.concludes(message.value, state.strikes, clock.now()))


# The engines


def _command(state: PageState, message: Timestamp[topics.Sender], clock: Clock) -> PageState:
    """The watchdog commands only while the operator is incapacitated: it may be older than this process."""
    if message.value != (TURN_OFF, WATCHDOG) or state.operator.activity is not None:
        return state
    return state._replace(operator=state.operator._replace(activity=INCAPACITATED, strikes_left=0))


def _engines(state: PageState, message: Timestamp[str], clock: Clock) -> PageState:
    return state._replace(engines=state.engines.reports(message.value, clock.now()))


def _cause(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
    found, age = cause.read(message.value), clock.age(message.timestamp)
    since = round(clock.elapsed() - age - found.since, 1)
    return state._replace(engines=state.engines.explains(found, clock.now() - age, since))


# The processes


def _diagnostics(namespace: str) -> Callable[[PageState, Any, Clock], PageState]:
    def change(state: PageState, message: Timestamp[Any], clock: Clock) -> PageState:
        programs, now = dict(state.programs), clock.now()
        for name, health in healths(message.value, namespace).items():
            if name in PROGRAMS:
                age = health.since_output
                output = None if age is None else round(clock.elapsed() - age, 2)
                programs[health.host, name] = programs.get((health.host, name), Program())._replace(
                    heard=now, ok=health.ok, reason=health.reason, output=output
                )
        for process in reported(message.value, namespace):
            if process.name in PROGRAMS:
                key = process.host, process.name
                programs[key] = programs.get(key, Program())._replace(
                    state=process.state, pid=process.pid, restarts=process.restarts, observed=now
                )
        return state._replace(programs=newest(programs))

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
        state = state._replace(hands=state.hands._replace(hold=hold))
        if hold.ended:
            page, why = hold.ended
            return refuse(page, BEAT, why)(state)
        return refuse(hold.refused[0], "press", hold.refused[1])(state) if hold.refused else state

    return change


def refuse(page: str, request: str, reason: str) -> Change:
    refusal = (page, request, reason)
    return lambda state: state._replace(refusals=state.refusals.add([refusal], MAX_REFUSALS))


def connected(loopback_is_up: bool) -> Change:
    """The loopback interface goes up or down."""
    return lambda state: state._replace(loopback_is_up=loopback_is_up)


def follows_scenario(name: str, follows: bool) -> Change:
    """A source of the configuration follows the scenario, or was set by hand."""
    return lambda state: state._replace(by_hand=state.by_hand - {name} if follows else state.by_hand | {name})
