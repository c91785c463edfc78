from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from typing import Any, NamedTuple

import pytest
import reactivex as rx
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from reactivex.testing import ReactiveTest, TestScheduler

from deploy.operator.engines import (
    BY_COMMAND,
    BY_CONTROLLER,
    BY_PAGE,
    BY_WATCHDOG,
    NOT_YET,
    OLDER,
    RESTARTED,
    Engines,
    Graph,
)
from deploy.operator.hold import OTHER_PAGE, Hold
from deploy.operator.page import state
from deploy.operator.page.history import History
from deploy.operator.page.state import Arm, Clock, Operator, PageState, Recent
from deploy.operator.page.updates import SILENT_CONTROLLER, Updates, lasting, view
from interfaces import topics
from interfaces.loopback import LOOPBACK_DOWN
from interfaces.topics import ALIVE, INCAPACITATED, MISSED, OFF, ON, TURN_OFF
from reactive_node import stamps
from reactive_node.stamps import Timestamp

on_next = ReactiveTest.on_next
START = datetime(2026, 1, 1, tzinfo=UTC)


class Play:
    """Plays messages to the recipes; times are seconds, and all messages are of their time of arrival."""

    def __init__(self, scheduler: TestScheduler) -> None:
        self._scheduler = scheduler
        self.clock = Clock(self.now, lambda stamp: (self.time_of_day() - stamp).total_seconds(), self.now)
        self.messages: dict[str, list[Any]] = {}
        self.changes: list[Any] = []
        self.watchdogs: list[Any] = []
        self.lines: list[Any] = []
        self.strangers = {"terminal"}
        self.controllers = [(0.0, frozenset({"first"}))]  # since when they are on the graph

    def now(self) -> float:
        return float(self._scheduler.clock)

    def time_of_day(self) -> datetime:
        return START + timedelta(seconds=self.now())

    def say(self, time: float, topic: topics.Topic, message: Any) -> None:
        stamped = Timestamp(message, START + timedelta(seconds=time))
        self.messages.setdefault(topic.name, []).append(on_next(time, stamped))

    def note(self, time: float, change: state.Change) -> None:
        self.changes.append(on_next(time, [change]))  # a callable would be a predicate

    def present_controllers(self) -> frozenset[str]:
        return [present for since, present in self.controllers if since <= self.now()][-1]

    def run(self, until: float, initial: PageState | None = None, *, opened: float = 200.5) -> PageState:
        def seen(topic: topics.Topic) -> rx.Observable[Any]:
            return self._scheduler.create_hot_observable(*self.messages.get(topic.name, []))

        def create() -> rx.Observable[PageState]:
            hot = self._scheduler.create_hot_observable
            always = state.always(
                seen,
                seen(topics.ENGINES_STATE),
                hot(*self.watchdogs),
                Graph(self.present_controllers, lambda: self.strangers),
                self.clock,
            )
            session = state.while_open(seen, hot(*self.lines), "/arm", self.clock)
            changes = rx.merge(
                always,
                hot(on_next(opened, session)).switch_latest(),
                hot(*self.changes).map(lambda it: it[0]),
            )
            return state.page_states(changes, initial or PageState())

        result = self._scheduler.start(create, disposed=until)
        states = [message.value.value for message in result.messages if message.value.kind == "N"]
        assert len(states) == len(result.messages), result.messages
        return states[-1] if states else initial or PageState()


@pytest.fixture
def play(scheduler: TestScheduler) -> Play:
    return Play(scheduler)


def stamp(time: float) -> Time:
    return stamps.to_message(START + timedelta(seconds=time))


def position(time: float, x: float, y: float) -> topics.Position:
    return topics.Position(stamps.to_nanoseconds(START + timedelta(seconds=time)), x, y)


# The arm


def test_arm_position_and_speed(play: Play) -> None:
    for time, name, value in ((210, "l1", 2.0), (211, "theta1", 0.5), (212, "theta1", 0.6)):
        play.say(time, topics.CONFIGURATION[name], value)
    play.say(213, topics.EFFECTOR_POSITION, position(213, 1.0, 2.0))
    play.say(214, topics.EFFECTOR_TWIST, topics.PlanarTwist(214 * 10**9, 0.15, -0.2, 0.0))

    shown = view(play.run(215), "page", 215)

    assert shown["arm"] == {"l1": 2.0, "l2": None, "theta1": 0.6, "theta2": None}
    assert shown["position"] == {"x": 1.0, "y": 2.0}
    assert shown["speed"] == 0.25


def test_trace_is_thinned_and_bounded(play: Play) -> None:
    for tick in range(8000):
        time = 201 + tick * 0.01
        play.say(time, topics.EFFECTOR_POSITION, position(time - 0.2, tick, 0.0))

    found = play.run(282)

    times = [sample[0] for sample in found.arm.samples.items]
    assert len(times) == state.MAX_SAMPLES
    assert 1800 <= found.arm.samples.total <= 2400, "at most 30 a second"
    assert times[-1] == pytest.approx(280.8, abs=0.05), "of the stamp, not of the arrival"
    assert times[-1] - times[0] >= 59.0, "the last minute"


def test_new_page_shows_nothing_of_the_last_one(play: Play) -> None:
    old = PageState(
        arm=Arm({"l1": 1.0}, position=(1.0, 1.0), speed=1.0),
        operator=Operator(seen=199.0, strikes_left=2),
    )

    shown = view(play.run(201, old), "page", 201)

    assert (shown["speed"], shown["position"], shown["arm"]["l1"]) == (None, None, None)
    assert shown["operator"] == {"seen": False, "age": None, "activity": None, "strikes_left": 2}


# The operator


def conclude(play: Play, *conclusions: tuple[float, str]) -> None:
    for time, conclusion in conclusions:
        play.say(time, topics.OPERATOR_ACTIVITY, conclusion)


def test_operator_is_seen_as_long_ago_as_the_stamp_says(play: Play) -> None:
    play.say(210, topics.OPERATOR_PRESENCE, START + timedelta(seconds=209.7))
    found = play.run(211)

    assert view(found, "page", 210.0)["operator"]["age"] == 0.3
    assert view(found, "page", 210.6)["operator"]["seen"] is True
    assert view(found, "page", 210.8)["operator"]["seen"] is False


@pytest.mark.parametrize(
    ("conclusions", "left"),
    [
        ([], 3),
        ([ALIVE], 3),
        ([ALIVE, MISSED], 2),
        ([ALIVE, MISSED, ALIVE], 2),
        ([MISSED, MISSED], 1),
        ([MISSED, MISSED, MISSED], 0),
        ([MISSED, MISSED, MISSED, INCAPACITATED], 0),
        ([MISSED, MISSED, MISSED, INCAPACITATED, ALIVE], 3),
    ],
)
def test_strikes_are_counted_from_the_start_of_the_watchdog(
    play: Play, conclusions: list[str], left: int
) -> None:
    play.watchdogs.append(on_next(201, True))
    conclude(play, *((210 + number, conclusion) for number, conclusion in enumerate(conclusions)))

    assert play.run(220).operator.strikes_left == left


def test_new_watchdog_begins_new_strikes(play: Play) -> None:
    play.watchdogs += [on_next(201, True), on_next(215, True)]
    conclude(play, (210, MISSED), (211, MISSED))

    assert play.run(220).operator.strikes_left == 3


def test_limits_are_those_of_this_arm(play: Play) -> None:
    initial = PageState(strikes=5, max_presence_age=0.2)
    play.watchdogs = [on_next(201, True)]
    conclude(play, (205, MISSED))
    play.say(208, topics.OPERATOR_PRESENCE, START + timedelta(seconds=208))

    found = play.run(210, initial)

    assert found.operator.strikes_left == 4
    assert view(found, "page", 208.1)["operator"]["seen"] is True
    assert view(found, "page", 208.3)["operator"]["seen"] is False


def test_strikes_of_an_older_watchdog_are_unknown_until_it_begins_again(play: Play) -> None:
    play.watchdogs.append(on_next(201, False))
    conclude(play, (210, MISSED))
    assert play.run(211).operator.strikes_left is None


def test_strikes_are_known_again_after_the_operator_was_incapacitated(play: Play) -> None:
    play.watchdogs.append(on_next(201, False))
    conclude(play, (210, MISSED), (213, INCAPACITATED), (214, ALIVE))
    assert play.run(215).operator.strikes_left == 3


# The switch


def switch(found: PageState, page: str, now: float) -> dict[str, Any]:
    shown: dict[str, Any] = view(found, page, now)["switch"]
    return shown


def test_page_that_holds_the_switch_is_shown_to_all_pages(play: Play) -> None:
    play.note(210, state.held(Hold("one", 210.0, alive=True)))
    found = play.run(211)

    assert switch(found, "one", 210.2) == {"held": True, "by": "this_page"}
    assert switch(found, "two", 210.2) == {"held": True, "by": "other_page"}
    assert switch(found, "one", 210.3) == {"held": False, "by": None}


def test_heartbeat_of_a_page_is_not_that_of_the_scenario(play: Play) -> None:
    play.note(210, state.held(Hold("one", 210.0, alive=True)))
    play.say(210.01, topics.OPERATOR_HEARTBEAT, True)
    play.note(210.02, state.held(Hold()))

    assert switch(play.run(211), "one", 210.1) == {"held": False, "by": None}


def test_heartbeat_of_a_page_may_come_after_its_release(play: Play) -> None:
    play.note(210, state.held(Hold("one", 210.0, alive=True)))
    play.note(210.01, state.held(Hold()))
    play.say(210.02, topics.OPERATOR_HEARTBEAT, True)

    assert switch(play.run(211), "one", 210.1) == {"held": False, "by": None}


def test_heartbeat_of_scenario_and_terminal_is_shown(play: Play) -> None:
    play.say(210, topics.OPERATOR_HEARTBEAT, True)
    found = play.run(211)

    assert switch(found, "one", 210.2) == {"held": True, "by": "scenario"}
    for change in (state.pressed(True), state.held_at_terminal(True)):
        assert switch(change(found), "one", 210.2) == {"held": True, "by": "terminal"}
    assert switch(found, "one", 210.3) == {"held": False, "by": None}


def test_refused_press_is_told_to_its_page(play: Play) -> None:
    play.note(210, state.held(Hold("one", 210.0, refused=("two", OTHER_PAGE))))
    found = play.run(211)

    assert Updates("two", play.clock).refusals(found) == [
        {"type": "refused", "request": "press", "why": "another page holds the switch"}
    ]
    assert Updates("one", play.clock).refusals(found) == []


def test_page_is_told_once_why_its_hold_was_lost(play: Play) -> None:
    why = "a beat came 310 ms late"
    for time in (210.0, 210.05):
        play.note(time, state.held(Hold(ended=("one", why))))
    found = play.run(211)

    assert Updates("one", play.clock).refusals(found) == [{"type": "released", "why": why}]
    assert Updates("two", play.clock).refusals(found) == []


# The engines


def engines(play: Play, *states: tuple[float, str]) -> None:
    for time, engines in states:
        play.say(time, topics.ENGINES_STATE, engines)


@pytest.mark.parametrize(("states", "why"), [([(210.9, OFF)], NOT_YET), ([(210, OFF), (210.9, ON)], "")])
def test_engines_that_were_never_on_or_are_on(play: Play, states: list[tuple[float, str]], why: str) -> None:
    engines(play, *states)

    shown = {"state": states[-1][1], "why": why, "since": None, "refused": None}
    assert view(play.run(212), "page", 211)["engines"] == shown


def test_silent_controller_is_no_state(play: Play) -> None:
    engines(play, (210, ON))

    shown = view(play.run(211), "page", 210.6)["engines"]
    assert (shown["state"], shown["why"]) == (None, SILENT_CONTROLLER)


@pytest.mark.parametrize("order", [(211.0, 211.01, 211.02), (211.01, 211.0, 211.02), (211.02, 211.01, 211.0)])
def test_watchdog_turned_them_off_whatever_arrives_first(
    play: Play, order: tuple[float, float, float]
) -> None:
    concluded, commanded, turned = order
    conclude(play, (205, ALIVE), (concluded, INCAPACITATED))
    play.say(commanded, topics.ENGINES, TURN_OFF)
    play.say(commanded + 0.5, topics.ENGINES, TURN_OFF)
    engines(play, (210, ON), (210.9, ON), (turned, OFF), (211.9, OFF))

    assert view(play.run(212), "page", 212)["engines"]["why"] == BY_WATCHDOG


def test_repeated_on_after_the_command_keeps_its_reason(play: Play) -> None:
    conclude(play, (205, ALIVE))
    play.say(210.0, topics.ENGINES, TURN_OFF)
    engines(play, (209, OFF), (209.5, ON), (210.01, ON), (210.02, OFF))

    assert view(play.run(211), "page", 210.1)["engines"]["why"] == BY_COMMAND


def sent_turn_off(service: str, ago: float) -> DiagnosticArray:
    status = health(f"/arm/{service}")
    status.values.append(KeyValue(key="seconds_since_turn_off", value=str(ago)))
    return diagnostics(status)


def why(found: PageState, now: float) -> str:
    text: str = view(found, "page", now)["engines"]["why"]
    return text


def test_page_tells_since_when_and_by_which_service_they_are_off(play: Play) -> None:
    conclude(play, (205, ALIVE))
    play.say(210.0, topics.ENGINES, TURN_OFF)
    engines(play, (209, ON), (210.02, OFF), (210.9, OFF), (220, OFF))
    play.say(210.5, topics.DIAGNOSTICS, sent_turn_off("velocity", 100.0))
    play.say(210.8, topics.DIAGNOSTICS, sent_turn_off("torque_guard", 0.81))

    shown = view(play.run(221), "page", 220.1)["engines"]
    assert (shown["why"], shown["since"]) == ("turned off by torque_guard", 210.0)


def test_service_that_turned_them_off_is_known_to_a_page_that_opens_later(play: Play) -> None:
    conclude(play, (205, ALIVE))
    play.say(210.0, topics.ENGINES, TURN_OFF)
    engines(play, (209, ON), (210.02, OFF), (249.9, OFF))
    play.say(249.5, topics.DIAGNOSTICS, sent_turn_off("torque_guard", 39.51))

    assert why(play.run(250, opened=249.4), 250.0) == "turned off by torque_guard"


def test_node_without_health_is_named_when_no_service_has_sent_the_command(play: Play) -> None:
    conclude(play, (205, ALIVE))
    play.say(210.0, topics.ENGINES, TURN_OFF)
    engines(play, (209, ON), (210.02, OFF), (213, OFF))
    found = play.run(214)

    assert why(found, 211.0) == BY_COMMAND
    assert why(found, 213.0) == "turned off by terminal"
    assert why(found._replace(heard_since=212.0), 213.0) == BY_COMMAND, "services may tell yet"
    nobody = found._replace(engines=found.engines._replace(strangers=()))
    assert why(nobody, 213.0) == BY_COMMAND
    two = found._replace(engines=found.engines._replace(strangers=("rqt", "terminal")))
    assert why(two, 213.0) == "turned off by rqt or terminal"


def test_watchdog_whose_conclusion_was_lost_is_known_by_its_health(play: Play) -> None:
    conclude(play, (205, ALIVE))
    play.say(210.0, topics.ENGINES, TURN_OFF)
    engines(play, (209, ON), (210.02, OFF))
    play.say(210.8, topics.DIAGNOSTICS, sent_turn_off("operator_watchdog", 0.8))

    assert why(play.run(211), 210.3) == BY_WATCHDOG


def test_page_turned_them_off(play: Play) -> None:
    play.note(210.0, state.turned_off(210.0))
    play.say(210.01, topics.ENGINES, TURN_OFF)
    conclude(play, (220, INCAPACITATED))
    play.say(220, topics.ENGINES, TURN_OFF)
    engines(play, (209, ON), (210.02, OFF), (221, OFF))

    assert view(play.run(222), "page", 221.1)["engines"]["why"] == BY_PAGE


@pytest.mark.parametrize(("off", "cause"), [(209.1, BY_CONTROLLER), (211, RESTARTED)])
def test_controller_turned_them_off_or_was_stopped(play: Play, off: float, cause: str) -> None:
    engines(play, (209, ON), (off, OFF))

    assert why(play.run(212), off + 0.1) == cause


def test_controller_was_killed_and_is_back_at_once(play: Play) -> None:
    play.controllers += [(210.1, frozenset({"first", "second"}))]  # DDS notices later that the first is gone
    engines(play, (209, ON), (210, ON), (210.2, OFF))

    assert view(play.run(211), "page", 210.3)["engines"]["why"] == RESTARTED


def test_controller_that_was_killed_before_turns_them_off_itself(play: Play) -> None:
    play.controllers += [(210.1, frozenset({"first", "second"})), (210.7, frozenset({"second"}))]
    engines(play, (209, ON), (210, ON), (210.2, OFF), (210.5, ON), (210.9, OFF))

    assert view(play.run(211), "page", 211.0)["engines"]["why"] == BY_CONTROLLER


def test_old_reason_is_forgotten_when_they_are_on_again(play: Play) -> None:
    play.say(210.0, topics.ENGINES, TURN_OFF)
    engines(play, (209, ON), (210.01, OFF), (210.5, ON), (210.6, ON), (210.7, OFF))

    assert view(play.run(211), "page", 210.8)["engines"]["why"] == BY_CONTROLLER


def test_restarted_page_program_does_not_guess(play: Play) -> None:
    engines(play, (209, OFF), (211, OFF))

    found = play.run(212, PageState(engines=Engines(since_when=OLDER)))
    assert view(found, "page", 211.1)["engines"]["why"] == OLDER


def test_restarted_page_program_recognizes_the_watchdog(play: Play) -> None:
    play.say(210, topics.ENGINES, TURN_OFF)
    engines(play, (209, OFF), (211, OFF))

    found = play.run(212, PageState(engines=Engines(since_when=OLDER)))
    shown = view(found, "page", 211.1)
    assert shown["engines"]["why"] == BY_WATCHDOG
    assert (shown["operator"]["activity"], shown["operator"]["strikes_left"]) == (INCAPACITATED, 0)


# The processes


def diagnostics(*status: DiagnosticStatus) -> DiagnosticArray:
    return DiagnosticArray(status=list(status))


def health(
    name: str, message: str = "running", since_output: str = "0.5", pid: int = 7, host: str = "robot1"
) -> DiagnosticStatus:
    values = {"pid": str(pid), "published": "1", "seconds_since_output": since_output}
    return DiagnosticStatus(
        name=name,
        level=DiagnosticStatus.OK if message == "running" else DiagnosticStatus.WARN,
        message=message,
        hardware_id=host,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def process(
    name: str, process_state: str = "RUNNING", pid: str = "7", restarts: str = "2", host: str = "robot1"
) -> DiagnosticStatus:
    values = {"process": name, "state": process_state, "pid": pid, "restarts": restarts}
    values |= {"uptime": "1.0", "last exit": "", "away": "0.0"}
    return DiagnosticStatus(
        name=f"/arm/sentinel: {name}",
        hardware_id=host,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def row(found: PageState, name: str, now: float) -> dict[str, Any]:
    return next(each for each in view(found, "page", now)["processes"] if each["name"] == name)


def test_process_is_shown_with_state_and_health(play: Play) -> None:
    play.say(210, topics.DIAGNOSTICS, diagnostics(process("kinematics"), process("velocity", "BACKOFF", "0")))
    play.say(210.5, topics.DIAGNOSTICS, diagnostics(health("/arm/kinematics", "l1: -1 is negative")))
    found = play.run(212)

    assert row(found, "kinematics", 211) == {
        "name": "kinematics",
        "host": "",
        "state": "RUNNING",
        "pid": 7,
        "restarts": 2,
        "since_output": 0.5,
        "ok": False,
        "health": "l1: -1 is negative",
    }
    assert row(found, "velocity", 211) == {
        "name": "velocity",
        "host": "",
        "state": "BACKOFF",
        "pid": 0,
        "restarts": 2,
        "since_output": None,
        "ok": False,
        "health": "no health yet",
    }


BOTH = ("robot1", "robot2")


@pytest.mark.parametrize("bad", BOTH)
def test_problem_of_either_of_two_hosts_of_a_program_is_shown(play: Play, bad: str) -> None:
    for host in BOTH:
        play.say(210, topics.DIAGNOSTICS, diagnostics(process("drive", host=host)))
        words = "too old" if host == bad else "running"
        play.say(210.5, topics.DIAGNOSTICS, diagnostics(health("/arm/drive", words, host=host)))

    shown = row(play.run(212), "drive", 211)
    assert (shown["state"], shown["ok"], shown["health"]) == ("RUNNING", False, "too old")


@pytest.mark.parametrize("bad", BOTH)
def test_state_of_a_process_on_one_host_hides_no_other(play: Play, bad: str) -> None:
    for host in BOTH:
        given = process("drive", "FATAL" if host == bad else "RUNNING", host=host)
        play.say(210, topics.DIAGNOSTICS, diagnostics(given))
        play.say(210.5, topics.DIAGNOSTICS, diagnostics(health("/arm/drive", host=host)))

    assert row(play.run(212), "drive", 211)["state"] == "FATAL"


def test_hosts_are_shown_if_there_is_more_than_one(play: Play) -> None:
    for host, *programs in (("robot1", "drive", "velocity"), ("robot2", "drive", "operator_page")):
        reports = [health(f"/arm/{program}", host=host) for program in programs]
        play.say(210 if host == "robot1" else 220, topics.DIAGNOSTICS, diagnostics(*reports))

    found = play.run(222)
    shown = {row["name"]: row["host"] for row in view(found, "page", 211)["processes"]}
    assert {name: host for name, host in shown.items() if host} == {
        "drive": "robot1, robot2",
        "velocity": "robot1",
        "operator_page": "robot2",
    }


def test_host_that_another_one_has_replaced_is_not_shown(play: Play) -> None:
    for time, host in ((210, "old"), (220, "new")):
        play.say(time, topics.DIAGNOSTICS, diagnostics(process("drive", host=host)))
        play.say(time + 0.5, topics.DIAGNOSTICS, diagnostics(health("/arm/drive", host=host)))

    shown = row(play.run(222), "drive", 221)
    assert (shown["ok"], shown["host"]) == (True, "new")


def test_silent_process_looks_silent(play: Play) -> None:
    play.say(210, topics.DIAGNOSTICS, diagnostics(process("kinematics"), health("/arm/kinematics")))

    silent = row(play.run(212), "kinematics", 214.2)
    assert (silent["state"], silent["ok"]) == ("UNKNOWN", False)
    assert (silent["health"], silent["since_output"]) == ("no health for 4 s", 4)


def test_a_loopback_that_is_down_is_the_health_of_the_sentinel() -> None:
    down = state.connected(False)(PageState())
    shown = row(down, "sentinel", 200.0)
    assert (shown["ok"], shown["health"]) == (False, f"loopback: {LOOPBACK_DOWN}")
    assert row(down, "velocity", 200.0)["health"] == "no health yet"
    assert row(state.connected(True)(down), "sentinel", 200.0)["health"] == "no health yet"


def test_diagnostics_of_others_are_not_shown(play: Play) -> None:
    others = (
        health("/kinematics"),
        health("/arm/driver"),
        process("bash"),
        DiagnosticStatus(name="/arm/kinematics"),
    )
    play.say(210, topics.DIAGNOSTICS, diagnostics(*others))

    found = play.run(212)
    assert row(found, "kinematics", 211)["health"] == "no health yet"
    assert len(view(found, "page", 211)["processes"]) == len(state.PROGRAMS)


def test_refused_turn_on_is_shown_for_a_while(play: Play) -> None:
    words = "engines: turn_on refused: no operator seen for 1.234 s (2 times); l1: nonsense"
    play.say(210, topics.DIAGNOSTICS, diagnostics(health("/arm/engine_controller", words)))
    found = play.run(212)

    assert view(found, "page", 219)["engines"]["refused"] == "no operator seen for 1.234 s (2 times)"
    assert view(found, "page", 221)["engines"]["refused"] is None


# Updates


class Written(NamedTuple):
    time: datetime
    kind: Any
    text: str


def test_first_update_tells_everything_and_the_next_the_changes(play: Play) -> None:
    updates = Updates("page", play.clock)

    first = updates.update(PageState(arm=Arm(speed=1.0)), "n1", 0.0)
    second = updates.update(PageState(arm=Arm(speed=1.0)), "n2", 0.05)
    third = updates.update(PageState(arm=Arm(speed=2.0)), "n3", 0.1)

    keys = {"arm", "position", "speed", "operator", "switch", "engines", "sources", "processes"}
    assert first.keys() == keys | {"type", "nonce", "time"}
    assert second == {"type": "update", "nonce": "n2", "time": 0.0}
    assert third == {"type": "update", "nonce": "n3", "time": 0.0, "speed": 2.0}


ON_AT = {"engines": {"state": "on"}}
OFF_AT = {"engines": {"state": "off"}}


def test_history_keeps_the_changes_of_the_last_minute() -> None:
    history = History()
    for time in range(64):
        history.note(float(time), OFF_AT if time in (0, 1, 3) else ON_AT)
    assert history.changes() == [(2.0, ON_AT), (3.0, OFF_AT), (4.0, ON_AT)], "with what was before"


def test_history_does_not_know_what_happened_while_no_page_was_open() -> None:
    history = History()
    for time in (0.0, 1.0, 20.0):
        history.note(time, ON_AT)
    assert history.changes() == [(0.0, ON_AT), (1.0, None), (20.0, ON_AT)]


def test_another_scenario_begins_another_history() -> None:
    history = History()
    for time in (100.0, -10.0):
        history.note(time, ON_AT)
    assert history.changes() == [(-10.0, ON_AT)]


def test_history_changes_only_when_something_happens(play: Play) -> None:
    play.say(210, topics.OPERATOR_PRESENCE, START + timedelta(seconds=209.7))
    found = play.run(211)
    assert lasting(found, 210.1) == lasting(found, 210.5), "the operator is seen, for longer"
    assert lasting(found, 210.5) != lasting(found, 210.8)


def test_page_that_opens_later_gets_the_trace_and_the_lines_of_the_last_minute(play: Play) -> None:
    for second in range(60):
        play.say(210 + second, topics.EFFECTOR_POSITION, position(210 + second, second, 0.0))
    kind = type("Kind", (), {"name": "STATE"})
    play.lines.append(on_next(211, [Written(START + timedelta(seconds=211), kind, "early")]))
    found = play.run(270)

    update = Updates("page", play.clock).update(found, "n", 270.0)
    assert [sample[1] for sample in update["trace"]] == list(range(60))
    assert [line["text"] for line in update["lines"]] == ["early"]


def test_updates_carry_new_samples_and_lines_once(play: Play) -> None:
    updates = Updates("page", play.clock)
    samples = tuple((float(number), 0.0, 0.0, None) for number in range(90))
    lines = ({"text": "a"}, {"text": "b"})

    first = updates.update(
        PageState(arm=Arm(samples=Recent(samples[:3], 3)), lines=Recent(lines, 2)), "n", 0.0
    )
    second = updates.update(
        PageState(arm=Arm(samples=Recent(samples[:5], 5)), lines=Recent(lines, 2)), "n", 0.0
    )
    third = updates.update(PageState(arm=Arm(samples=Recent(samples, 500))), "n", 0.0)

    assert (first["trace"], first["lines"]) == (samples[:3], lines)
    assert (second["trace"], "lines" in second) == (samples[3:5], False)
    assert third["trace"] == samples, "a slow page gets the newest"


def test_lines_are_numbered_in_milliseconds_of_the_scenario_and_bounded(play: Play) -> None:
    kind = type("Kind", (), {"name": "SPEED"})
    batch = [Written(START + timedelta(seconds=209.5), kind, f"line {number}") for number in range(500)]
    play.lines.append(on_next(210, batch))

    found = play.run(212)
    assert len(found.lines.items) == state.MAX_LINES
    assert found.lines.items[-1] == {"time": 209500, "kind": "speed", "text": "line 499"}
    assert found.lines.total == 500


def test_all_values_of_an_update_are_json(play: Play) -> None:
    update = Updates("page", play.clock).update(play.run(210), "n", 210.0)

    def check(value: object) -> None:
        if isinstance(value, dict):
            assert all(isinstance(key, str) for key in value)
            for each in value.values():
                check(each)
        elif isinstance(value, list | tuple):
            for each in value:
                check(each)
        else:
            assert value is None or isinstance(value, str | bool | int) or math.isfinite(value)

    check(update)
