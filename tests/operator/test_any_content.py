"""Terminal, page, sentinel, fleet, hosts and controller survive any content, and go on with good messages."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import reactivex as rx
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from hypothesis import example, given
from hypothesis import strategies as st
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterType, ParameterValue
from rclpy.serialization import serialize_message
from reactivex.subject import Subject
from reactivex.testing import TestScheduler

from deploy.commands.hosts import Hosts
from deploy.commands.status import of_services
from deploy.operator.fleet import Arm, row, watched
from deploy.operator.lines import Line, line_batches
from deploy.operator.page import state
from deploy.operator.page.updates import view
from deploy.operator.remote import PARAMETER_EVENTS, parameter_changes
from deploy.supervision.policy import Policy
from deploy.supervision.probe import Probe
from deploy.supervision.sentinel import reported
from deploy.supervision.supervisord import Program
from interfaces import topics
from interfaces.latch import Command, Presence
from interfaces.limits import MOST_KNOWN
from interfaces.service.clocks import MOST_HOSTS, Clocks
from interfaces.service.health import healths
from interfaces.service.reading import reading, unreported
from interfaces.topics import DIAGNOSTICS, ENGINES, ENGINES_STATE, OPERATOR_PRESENCE
from reactive_node.stamps import Timestamp, stamped
from services.engine_controller import engine_state, turns
from tests.messages import ODD_NUMBERS, messages, octets, reports

ARM = "/arm"
NODES = tuple(f"{ARM}/{name}" for name in ("velocity", "engine_controller", "sentinel", "operator_watchdog"))
TIMES = st.integers(-(2**63), 2**63 - 1)  # source times, of the sender's choice [ns]
READ = (*topics.CONTRACT, PARAMETER_EVENTS)
EVENTS = st.builds(
    ParameterEvent,
    node=st.just(f"{ARM}/dead_mans_switch"),
    changed_parameters=st.lists(messages(Parameter), max_size=2),
)
SENT = st.lists(
    st.one_of(
        *(st.tuples(st.just(topic.name), octets(topic.type), TIMES) for topic in READ),
        st.tuples(st.just(DIAGNOSTICS.name), reports(*NODES).map(serialize_message), TIMES),
        st.tuples(st.just(PARAMETER_EVENTS.name), EVENTS.map(serialize_message), TIMES),
    ),
    max_size=8,
)
"""Messages of strangers: topic, octets and source time."""
Sent = list[tuple[str, bytes, int]]
NOW = datetime(2026, 1, 1, tzinfo=UTC)


class Site:
    """The topics of an arm, as its readers hear them."""

    def __init__(self) -> None:
        self._subjects: dict[str, Subject[Any]] = {topic.name: Subject() for topic in READ}
        self.read = {topic.name: reading(topic, unreported, timestamped=True)["item"] for topic in READ}
        self.errors: list[Exception] = []
        self.scheduler = TestScheduler()

    def seen(self, topic: topics.Topic) -> rx.Observable[Any]:
        return self._subjects[topic.name]

    def values(self, topic: topics.Topic) -> rx.Observable[Any]:
        return self.seen(topic).map(lambda it: it.value)

    def follow(self, recipe: rx.Observable[Any], on_next: Callable[[Any], None]) -> None:
        recipe.subscribe(on_next, self.errors.append, scheduler=self.scheduler)
        self.scheduler.advance_by(0.01)

    def receive(self, name: str, data: bytes, time: int) -> None:
        value = self.read[name](stamped(data, time))
        if value is not None:
            self._subjects[name].on_next(value)
            self.scheduler.advance_by(0.01)
        assert not self.errors

    def send(self, topic: topics.Topic, message: Any, at: datetime = NOW) -> None:
        data = Timestamp(serialize_message(message), at)
        self.receive(topic.name, data.value, data.nanoseconds)


def health(program: str, *, level: bytes = DiagnosticStatus.OK, message: str = "running") -> DiagnosticArray:
    values = [KeyValue(key=key, value="7") for key in ("pid", "published", "seconds_since_output")]
    status = DiagnosticStatus(
        level=level, name=f"{ARM}/{program}", message=message, hardware_id="robot", values=values
    )
    return DiagnosticArray(status=[status])


def process(**values: str) -> DiagnosticArray:
    given = {"process": "velocity", "state": "RUNNING", "pid": "7", "restarts": "0", "uptime": "1"}
    given |= {"last exit": "code 1", "away": "1"} | values
    pairs = [KeyValue(key=key, value=value) for key, value in given.items()]
    status = DiagnosticStatus(name=f"{ARM}/sentinel: velocity", hardware_id="robot", values=pairs)
    return DiagnosticArray(status=[status])


def odd_reports() -> Sent:
    """Return reports of one process in which one number after the other is none."""
    keys = ("restarts", "uptime", "away", "pid")
    odd = [process(**{key: number}) for key in keys for number in ODD_NUMBERS]
    return [(DIAGNOSTICS.name, serialize_message(each), 0) for each in (health("velocity"), process(), *odd)]


@example(odd_reports())
@given(SENT)
def test_terminal(sent: Sent) -> None:
    site, shown, ticks = Site(), list[Line](), Subject[None]()
    site.follow(line_batches(site.seen, ticks, ARM), shown.extend)
    for each in sent:
        site.receive(*each)
        ticks.on_next(None)
    bad = health("velocity", level=DiagnosticStatus.WARN, message="planted")
    site.send(DIAGNOSTICS, bad, datetime(2400, 1, 1, tzinfo=UTC))  # strangers may use up this second's lines
    ticks.on_next(None)
    assert "velocity: planted" in [line.text for line in shown]


@example(odd_reports())
@given(SENT)
def test_page(sent: Sent) -> None:
    site, states = Site(), [state.PageState()]
    clock = state.Clock(
        lambda: 10.0, lambda stamp: (NOW - stamp).total_seconds(), lambda: 10.0, lambda _: 0.0
    )
    watchdogs: Subject[bool] = Subject()
    changes = rx.merge(
        state.always(site.seen, watchdogs, clock),
        state.while_open(site.seen, rx.never(), ARM, clock),
    )
    site.follow(state.page_states(changes, states[0]), states.append)
    for each in sent:
        site.receive(*each)
        json.dumps(view(states[-1], "page", 10.0))
    site.send(topics.L1, topics.L1.message(2.5))
    shown = view(states[-1], "page", 10.0)
    assert shown["arm"]["l1"] == 2.5


@given(SENT)
def test_parameters(sent: Sent) -> None:
    site, changes = Site(), list[Any]()
    site.follow(parameter_changes(site.values(PARAMETER_EVENTS), ARM), changes.append)
    for each in sent:
        site.receive(*each)
    value = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=True)
    event = ParameterEvent(node=f"{ARM}/switch", changed_parameters=[Parameter(name="pressed", value=value)])
    site.send(PARAMETER_EVENTS, event)
    assert changes[-1] == ("switch", "pressed", True, {"pressed": True})


@given(SENT)
def test_fleet(sent: Sent) -> None:
    site, arms = Site(), [Arm(ARM, 0)]
    site.follow(watched(arms[0], site.values, lambda: 10.0), arms.append)
    for each in sent:
        site.receive(*each)
        row(arms[-1], 10.0)
    site.send(ENGINES_STATE, ENGINES_STATE.message(topics.ON))
    assert row(arms[-1], 10.0)[4] == topics.ON


@given(SENT)
def test_sentinel(sent: Sent) -> None:
    site, policy, heard = Site(), Policy(), list[Any]()
    program = Program("velocity", "RUNNING", 7, 1.0, 0, "", "")
    probe = Probe(Path(), SimpleNamespace(pid=0))  # type: ignore[arg-type]
    site.follow(site.values(DIAGNOSTICS), heard.append)
    for each in sent:
        site.receive(*each)
    site.send(DIAGNOSTICS, health("velocity"))
    for message in heard:
        found = healths(message, ARM)
        probe.hear(found)
        assert all(0 <= each.pid < 10**9 for each in found.values())
        assert all(0 <= each.restarts < 10**9 for each in reported(message, ARM))
    assert found["velocity"].pid == 7
    assert policy.reasons == {}
    assert program.pid == 7


@given(SENT)
def test_hosts_and_status(sent: Sent) -> None:
    site, hosts, clocks = Site(), Hosts(ARM), Clocks(ARM)
    site.follow(site.values(DIAGNOSTICS), lambda it: (hosts.hear(it), clocks.hear(it), clocks.problem()))
    for each in sent:
        site.receive(*each)
    hosts.clocks()
    programs = [*hosts.processes.values(), Program("velocity", "RUNNING", 7, 1.0, 0, "", "", host="robot")]
    site.send(DIAGNOSTICS, health("velocity"))
    assert "ok" in of_services(programs, hosts.healths)


def test_readers_remember_a_bounded_number_of_strangers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("interfaces.service.clocks.WINDOW", math.inf)  # however long the test takes
    site, hosts, clocks, arms, states = Site(), Hosts(ARM), Clocks(ARM), [Arm(ARM, 0)], [state.PageState()]
    clock = state.Clock(lambda: 10.0, lambda stamp: 0.0, lambda: 10.0, lambda _: 0.0)
    site.follow(site.values(DIAGNOSTICS), hosts.hear)
    site.follow(site.values(DIAGNOSTICS), clocks.hear)
    site.follow(watched(arms[0], site.values, lambda: 10.0), arms.append)
    page = state.page_states(state.while_open(site.seen, rx.never(), ARM, clock), states[0])
    site.follow(page, states.append)
    for number in range(2 * MOST_KNOWN):
        for message in (health(f"s{number}"), process(), health("velocity"), health("drive")):
            message.status[0].hardware_id = f"host{number}"
            site.send(DIAGNOSTICS, message)
    kept = (hosts.healths, hosts.processes, arms[-1].healths, arms[-1].states, states[-1].programs)
    assert all(len(each) <= MOST_KNOWN for each in kept)
    assert len(clocks.differences()) == MOST_HOSTS


@given(SENT)
def test_controller(sent: Sent) -> None:
    site, states = Site(), list[Any]()

    def age(stamp: datetime) -> float:
        return (NOW - stamp).total_seconds()

    def now() -> datetime:
        return site.scheduler.now

    commands = site.seen(ENGINES).map(lambda it: Command(now(), age(it.timestamp), it.value))
    presences = site.values(OPERATOR_PRESENCE).map(lambda it: Presence(now(), age(it)))
    site.follow(engine_state(turns(commands, presences)), states.append)
    for each in sent:
        site.receive(*each)
    site.send(ENGINES, ENGINES.message(topics.TURN_OFF))
    site.scheduler.advance_by(timedelta(seconds=0.2))
    assert states[-1] == topics.OFF
    site.send(OPERATOR_PRESENCE, OPERATOR_PRESENCE.message(NOW))
    site.send(ENGINES, ENGINES.message(topics.TURN_ON))
    assert states[-1] == topics.ON
