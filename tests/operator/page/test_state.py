from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from typing import Any, NamedTuple

import pytest
import reactivex as rx
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from reactivex.testing import ReactiveTest, TestScheduler
from std_msgs.msg import Header

from deploy.operator.hold import OTHER_PAGE, Hold
from deploy.operator.page import state
from deploy.operator.page.history import History
from deploy.operator.page.state import Arm, Clock, PageState, Recent
from deploy.operator.page.updates import SILENT_CONTROLLER, Updates, lasting, view
from deploy.operator.strikes import Operator
from interfaces import cause, topics
from interfaces.cause import Cause
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
        self.clock = Clock(
            self.now,
            lambda time: (self.time_of_day() - time).total_seconds(),
            self.now,
            lambda stamp: (self.time_of_day() - stamps.from_nanoseconds(stamp)).total_seconds(),
        )
        self.messages: dict[str, list[Any]] = {}
        self.changes: list[Any] = []
        self.watchdogs: list[Any] = []
        self.lines: list[Any] = []

    def now(self) -> float:
        return float(self._scheduler.clock)

    def time_of_day(self) -> datetime:
        return START + timedelta(seconds=self.now())

    def say(self, time: float, topic: topics.Topic, message: Any) -> None:
        stamped = Timestamp(message, START + timedelta(seconds=time))
        self.messages.setdefault(topic.name, []).append(on_next(time, stamped))

    def note(self, time: float, change: state.Change) -> None:
        self.changes.append(on_next(time, [change]))  # a callable would be a predicate

    def run(self, until: float, initial: PageState | None = None) -> PageState:
        def seen(topic: topics.Topic) -> rx.Observable[Any]:
            return self._scheduler.create_hot_observable(*self.messages.get(topic.name, []))

        def create() -> rx.Observable[PageState]:
            hot = self._scheduler.create_hot_observable
            always = state.always(seen, hot(*self.watchdogs), self.clock)
            session = state.while_open(seen, hot(*self.lines), "/arm", self.clock)
            changes = rx.merge(
                always,
                hot(on_next(200.5, session)).switch_latest(),
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

    shown = view(play.run(215), "page", 214.1)

    assert shown["arm"] == {"l1": 2.0, "l2": None, "theta1": 0.6, "theta2": None}
    assert shown["position"] == {"x": 1.0, "y": 2.0}
    assert shown["speed"] == 0.25


def still_arm(play: Play) -> None:
    """An arm that stands from 210 s on; its speed comes until 219.9 s."""
    for name in topics.CONFIGURATION:
        play.say(210, topics.CONFIGURATION[name], 1.0)
    play.say(210, topics.EFFECTOR_POSITION, position(210, 1.0, 2.0))
    for tick in range(100):
        play.say(210 + 0.1 * tick, topics.EFFECTOR_TWIST, topics.PlanarTwist(0, 0.0, 0.0, 0.0))


def test_arm_that_stands_is_known_while_its_speed_comes(play: Play) -> None:
    still_arm(play)
    found = play.run(230)
    for now in (219.9, 220.1):
        assert (view(found, "page", now)["unheard"], view(found, "page", now)["speed"]) == ([], 0.0)
    shown = view(found, "page", 220.3)
    assert shown["unheard"] == [*topics.CONFIGURATION, "position"]
    assert shown["speed"] is None


def test_joint_that_is_silent_is_unknown_although_another_moves(play: Play) -> None:
    for name in topics.CONFIGURATION:
        play.say(210, topics.CONFIGURATION[name], 1.0)
    for tick in range(20):
        play.say(210 + 0.1 * tick, topics.CONFIGURATION["theta1"], 1.0)
        play.say(210 + 0.1 * tick, topics.EFFECTOR_POSITION, position(210, 1.0, 2.0))
    assert view(play.run(212), "page", 212)["unheard"] == ["l1", "l2", "theta2", "position"]


def test_position_that_does_not_follow_the_joints_is_unknown(play: Play) -> None:
    still_arm(play)
    play.say(215, topics.CONFIGURATION["theta1"], 2.0)
    found = play.run(215.5)
    assert view(found, "page", 215.1)["unheard"] == ["position"]


def test_trace_of_an_arm_that_stands_goes_on_until_its_speed_is_unknown(play: Play) -> None:
    still_arm(play)
    times = [sample[0] for sample in play.run(230).arm.samples.items]
    assert (times[0], times[-1]) == (210.0, pytest.approx(219.9, abs=0.11))
    assert max(after - before for before, after in pairwise(times)) < state.UNHEARD


def test_speed_that_is_unknown_is_not_in_the_trace(play: Play) -> None:
    play.say(210, topics.EFFECTOR_TWIST, topics.PlanarTwist(0, 1.1, 0.0, 0.0))
    for tick in range(10):
        play.say(210.1 + 0.07 * tick, topics.EFFECTOR_POSITION, position(210.1 + 0.07 * tick, 1.0, 2.0))
    speeds = [(sample[0] > 210.3, sample[3]) for sample in play.run(212).arm.samples.items]
    assert set(speeds) == {(False, 1.1), (True, None)}


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


def hand(play: Play, node: str, *times: float) -> None:
    """Each heartbeat of a hand, with its name."""
    for time in times:
        play.say(time, topics.OPERATOR_HAND, Header(frame_id=node))
        play.say(time, topics.OPERATOR_HEARTBEAT, True)


def test_heartbeat_of_a_page_may_come_after_its_release(play: Play) -> None:
    play.note(210, state.held(Hold("one", 210.0, alive=True)))
    play.note(210.01, state.held(Hold()))
    hand(play, "operator_page", 210.02)

    assert switch(play.run(211), "one", 210.1) == {"held": False, "by": None}


@pytest.mark.parametrize(
    ("node", "by"),
    [("dead_mans_switch", "dead_mans_switch"), ("terminal_7", "terminal"), ("joystick", "joystick")],
)
def test_node_that_holds_is_named(play: Play, node: str, by: str) -> None:
    hand(play, node, 210)
    found = play.run(211)

    assert switch(found, "one", 210.2) == {"held": True, "by": by}
    assert switch(found, "one", 210.3) == {"held": False, "by": None}


def test_hand_that_has_taken_the_switch_is_named(play: Play) -> None:
    hand(play, "dead_mans_switch", 210.0)
    hand(play, "terminal_7", 210.2)
    hand(play, "operator_page", 210.21)

    assert switch(play.run(211), "one", 210.3)["by"] == "terminal"


def test_heartbeats_without_a_name_are_held_by_somebody(play: Play) -> None:
    play.say(210, topics.OPERATOR_HEARTBEAT, True)

    assert switch(play.run(211), "one", 210.2) == {"held": True, "by": None}


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


@pytest.mark.parametrize(
    ("events", "now", "stops_in"),
    [
        ([], 210.0, 9.0),  # three silences from the last conclusion on
        ([(213.0, MISSED)], 214.0, 5.0),
        ([(213.0, MISSED), (216.0, MISSED)], 216.5, 2.5),
        ([(213.0, MISSED), (213.5, ALIVE)], 214.0, 5.5),  # strikes stay
        ([(213.0, MISSED), (216.0, MISSED), (219.0, MISSED), (219.0, INCAPACITATED)], 219.0, 0.0),
    ],
)
def test_engines_that_are_on_tell_when_they_stop_by_themselves(
    play: Play, events: list[tuple[float, str]], now: float, stops_in: float
) -> None:
    play.watchdogs.append(on_next(201, True))
    conclude(play, (210.0, ALIVE), *events)
    play.say(now, topics.ENGINES_STATE, ON)
    play.say(210.0, topics.OPERATOR_PRESENCE, START + timedelta(seconds=209.9))
    assert view(play.run(now + 0.1), "page", now)["engines"]["stops_in"] == stops_in


@pytest.mark.parametrize("known", [False, True])
def test_controller_stops_them_if_the_strikes_take_longer(play: Play, known: bool) -> None:
    play.say(210.0, topics.OPERATOR_PRESENCE, START + timedelta(seconds=209.5))
    play.say(212.0, topics.ENGINES_STATE, ON)
    if known:
        play.watchdogs.append(on_next(201, True))
        conclude(play, (210.0, ALIVE))
    found = play.run(212.1, PageState(silence=60.0))
    assert view(found, "page", 212.0)["engines"]["stops_in"] == 7.5


def test_engines_that_are_held_tell_when_they_would_stop(play: Play) -> None:
    play.watchdogs.append(on_next(201, True))
    conclude(play, (205.0, ALIVE), (208.0, MISSED), (210.0, ALIVE))
    play.say(211.0, topics.OPERATOR_HEARTBEAT, True)
    play.say(211.0, topics.ENGINES_STATE, ON)
    found = play.run(211.1)
    assert view(found, "page", 211.1)["engines"]["stops_in"] == 6.0, "with two strikes left"
    assert view(found, "page", 211.6)["engines"]["stops_in"] is None, "nobody knows whether they are on"


def engines(play: Play, *states: tuple[float, str]) -> None:
    for time, engines in states:
        play.say(time, topics.ENGINES_STATE, engines)


def explained(play: Play, time: float, cause_: Cause) -> None:
    play.say(time, topics.ENGINES_CAUSE, cause.message(cause_))


@pytest.mark.parametrize(
    ("found", "why"),
    [
        (Cause(OFF, "started", since=0.5), "not turned on since engine_controller started"),
        (Cause(ON, "turn_on", "terminal_7", since=0.5), "turned on by terminal_7"),
    ],
)
def test_controller_tells_why_and_since_when(play: Play, found: Cause, why: str) -> None:
    engines(play, (210.9, found.state))
    explained(play, 210.5, found)

    shown = {"state": found.state, "why": why, "since": 210.0, "refused": None, "stops_in": None}
    assert view(play.run(212), "page", 211)["engines"] == shown


def test_silent_controller_is_no_state(play: Play) -> None:
    engines(play, (210, ON))

    shown = view(play.run(211), "page", 210.6)["engines"]
    assert (shown["state"], shown["why"]) == (None, SILENT_CONTROLLER)


def test_controller_that_was_late_is_not_told_to_be_dead(play: Play) -> None:
    engines(play, (209, ON), (209.6, OFF))
    explained(play, 209.65, Cause(OFF, "paused", age=0.52))

    why = view(play.run(212), "page", 210.0)["engines"]["why"]
    assert why == "turned off by engine_controller (it stood still for 0.5 s)"


def test_cause_of_another_state_is_not_shown(play: Play) -> None:
    explained(play, 209, Cause(ON, "turn_on", "terminal_7"))
    engines(play, (209, ON), (210, OFF))

    shown = view(play.run(211), "page", 210.1)["engines"]
    assert (shown["state"], shown["why"], shown["since"]) == (OFF, "", None)


def test_cause_that_is_older_than_the_page_tells_its_time(play: Play) -> None:
    engines(play, (211, OFF))
    latched = Timestamp(cause.message(Cause(OFF, "turn_off", "guard", since=0.1)), START)
    play.messages[topics.ENGINES_CAUSE.name] = [on_next(211, latched)]

    shown = view(play.run(212), "page", 211.1)["engines"]
    assert (shown["why"], shown["since"]) == ("turned off by guard", -0.1)


def test_refused_turn_on_is_shown_for_a_while(play: Play) -> None:
    explained(play, 210, Cause(OFF, "started", refused="no operator seen yet"))
    engines(play, (211, OFF), (221, OFF))
    found = play.run(222)

    assert view(found, "page", 211)["engines"]["refused"] == "no operator seen yet"
    assert view(found, "page", 221)["engines"]["refused"] is None


@pytest.mark.parametrize(("node", "activity"), [("operator_watchdog", INCAPACITATED), ("guard", None)])
def test_page_that_began_later_recognizes_the_watchdog(play: Play, node: str, activity: str | None) -> None:
    play.say(210, topics.ENGINES_SENDER, topics.Sender(TURN_OFF, node))

    shown = view(play.run(212), "page", 211.1)["operator"]
    assert (shown["activity"], shown["strikes_left"]) == (activity, 0 if activity else None)


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
        "output": 210.0,
        "ok": False,
        "health": "l1: -1 is negative",
    }
    assert row(found, "velocity", 211) == {
        "name": "velocity",
        "host": "",
        "state": "BACKOFF",
        "pid": 0,
        "restarts": 2,
        "output": None,
        "ok": False,
        "health": "no health yet",
    }


BOTH = ("robot1", "robot2")


@pytest.mark.parametrize("bad", BOTH)
@pytest.mark.parametrize(("state", "words"), [("RUNNING", "too old"), ("FATAL", "running")])
def test_problem_of_either_of_two_hosts_of_a_program_is_shown(
    play: Play, bad: str, state: str, words: str
) -> None:
    for host in BOTH:
        given = (state, words) if host == bad else ("RUNNING", "running")
        play.say(210, topics.DIAGNOSTICS, diagnostics(process("drive", given[0], host=host)))
        play.say(210.5, topics.DIAGNOSTICS, diagnostics(health("/arm/drive", given[1], host=host)))

    shown = row(play.run(212), "drive", 211)
    assert (shown["state"], shown["ok"], shown["health"]) == (state, words == "running", words)


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
    assert silent["health"] == "no health for 4 s"


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


# Updates


class Written(NamedTuple):
    time: datetime
    kind: Any
    text: str


def test_first_update_tells_everything_and_the_next_the_changes(play: Play) -> None:
    updates = Updates("page", play.clock)

    first = updates.update(PageState(arm=Arm(speed=1.0, sped=math.inf)), "n1", 0.0)
    second = updates.update(PageState(arm=Arm(speed=1.0, sped=math.inf)), "n2", 0.05)
    third = updates.update(PageState(arm=Arm(speed=2.0, sped=math.inf)), "n3", 0.1)

    keys = {"arm", "position", "speed", "unheard", "operator", "switch", "engines", "sources", "processes"}
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
