from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
import reactivex as rx
from hypothesis import given
from hypothesis import strategies as st
from reactivex.scheduler import ImmediateScheduler
from reactivex.subject import Subject
from reactivex.testing import ReactiveTest, TestScheduler

from interfaces.latch import Command, Comparison, Event, Latch, Presence, Tick
from interfaces.permission import NEVER
from interfaces.service import Rejected
from interfaces.topics import CLOCK_TOLERANCE, DRIVE_TIMEOUT, OFF, ON, TURN_OFF, TURN_ON
from reactive_node.stamps import Timestamp
from services.engine_controller import Parameters, engine_state, step, turns

on_next, subscribe = ReactiveTest.on_next, ReactiveTest.subscribe


def at_time(seconds: float) -> datetime:
    return datetime.fromtimestamp(seconds, UTC)


def latch(engines: str, seen: float | None, repeated: float, *outputs: str) -> Latch:
    return Latch(engines, NEVER if seen is None else at_time(seen), at_time(repeated), outputs)


def presence(age: float) -> Presence:
    return Presence(at_time(NOW), age)


def command(name: str, age: float = 0.0) -> Command:
    return Command(at_time(NOW), age, name)


def refusing(latch: Latch, refusal: str = "one is wrong") -> Latch:
    return latch._replace(refusal=refusal)


NOW = 100.0
OFF_AND_SEEN = latch(OFF, 99.5, 99.9)
ON_AND_SEEN = latch(ON, 99.5, 99.9)
TICK = Tick(at_time(NOW))


@pytest.mark.parametrize(
    ("before", "event", "after"),
    [
        (OFF_AND_SEEN, TICK, latch(OFF, 99.5, NOW, OFF)),
        (ON_AND_SEEN, TICK, latch(ON, 99.5, NOW, ON)),
        (ON_AND_SEEN, command(TURN_OFF), latch(OFF, 99.5, NOW, OFF)),
        (refusing(ON_AND_SEEN), command(TURN_OFF), refusing(latch(OFF, 99.5, NOW, OFF))),
        (OFF_AND_SEEN, Comparison(at_time(NOW), "one is wrong"), refusing(OFF_AND_SEEN)),
        (ON_AND_SEEN, Comparison(at_time(NOW), "one is wrong"), refusing(ON_AND_SEEN)),
        (refusing(OFF_AND_SEEN), Comparison(at_time(NOW), ""), OFF_AND_SEEN),
        (latch(ON, 90.0, 99.9), Comparison(at_time(NOW), ""), latch(OFF, 90.0, NOW, OFF)),
        (ON_AND_SEEN, command(TURN_OFF, 99.0), latch(OFF, 99.5, NOW, OFF)),
        (OFF_AND_SEEN, command(TURN_ON), latch(ON, 99.5, NOW, ON)),
        (OFF_AND_SEEN, command(TURN_OFF), OFF_AND_SEEN),
        (ON_AND_SEEN, command(TURN_ON), ON_AND_SEEN),
        (OFF_AND_SEEN, command(TURN_ON, 0.999), latch(ON, 99.5, NOW, ON)),
        (latch(OFF, 99.001, 99.9), command(TURN_ON), latch(ON, 99.001, NOW, ON)),
        (OFF_AND_SEEN, presence(0.125), latch(OFF, 99.875, 99.9)),
        (OFF_AND_SEEN, presence(0.75), OFF_AND_SEEN),  # an older one than the last
        (OFF_AND_SEEN, presence(-CLOCK_TOLERANCE), latch(OFF, NOW, 99.9)),
        (latch(ON, 90.001, 99.9), TICK, latch(ON, 90.001, NOW, ON)),
        (latch(ON, 90.0, 99.9), TICK, latch(OFF, 90.0, NOW, OFF)),
        (latch(ON, 90.0, 99.9), presence(0.0), latch(OFF, NOW, NOW, OFF)),
        (latch(ON, 99.5, 99.6), TICK, latch(ON, 99.5, NOW, ON)),
        (latch(ON, 99.5, 99.599), TICK, latch(OFF, 99.5, NOW, OFF)),
        (latch(ON, 99.5, 99.599), presence(0.0), latch(OFF, NOW, NOW, OFF)),
        (latch(ON, 99.5, 99.599), command(TURN_ON), latch(ON, 99.5, NOW, ON)),  # a new start
    ],
)
def test_step(before: Latch, event: Event, after: Latch) -> None:
    assert step(before, event) == after


@pytest.mark.parametrize(
    ("before", "event", "topic", "reason"),
    [
        (OFF_AND_SEEN, command(TURN_ON, 1.0), "engines", "turn_on refused: 1.000 s old"),
        (OFF_AND_SEEN, command(TURN_ON, -1.0), "engines", "turn_on refused: -1.000 s old"),
        (refusing(OFF_AND_SEEN), command(TURN_ON, -1.0), "engines", "turn_on refused: one is wrong"),
        (latch(OFF, None, 99.9), command(TURN_ON), "engines", "turn_on refused: no operator seen yet"),
        (
            latch(OFF, 99.0, 99.9),
            command(TURN_ON),
            "engines",
            "turn_on refused: no operator seen for 1.000 s",
        ),
        (
            ON_AND_SEEN,
            presence(-0.051),
            "operator_presence",
            "it is stamped by a clock that is 0.051 s ahead of ours",
        ),
    ],
)
def test_step_rejects(before: Latch, event: Event, topic: str, reason: str) -> None:
    after = step(before, event)

    (rejected,) = after.outputs
    assert isinstance(rejected, Rejected)
    assert (rejected.topic.name, rejected.reason) == (topic, reason)
    assert after._replace(outputs=()) == before
    assert step(after, TICK).outputs == (before.engines,)


def test_event_that_comes_too_late_is_rejected_and_turns_off() -> None:
    rejected, engines = step(latch(ON, 90.0, 99.9), command(TURN_ON, 2.0)).outputs

    assert isinstance(rejected, Rejected)
    assert engines == OFF


@pytest.mark.parametrize("refusal", ["", "one is wrong"])
def test_comparison_of_clocks_keeps_no_engines_on(refusal: str) -> None:
    """With two hosts, reports of health show their clocks: the controller may only refuse `turn_on`."""
    assert step(refusing(ON_AND_SEEN, refusal), command(TURN_OFF)).engines == OFF
    for event in (TICK, command(TURN_ON), Comparison(at_time(NOW), refusal)):
        assert step(refusing(latch(ON, 90.0, NOW), refusal), event).engines == OFF


def test_comparison_of_clocks_turns_no_engines_on() -> None:
    compared = step(latch(OFF, None, NOW), Comparison(at_time(NOW), ""))
    assert compared.engines == OFF
    assert step(compared, command(TURN_ON)).engines == OFF


class Engines:
    """The recipe between a virtual operator and a list of states, with a wall clock that can be set."""

    def __init__(self) -> None:
        self.scheduler = TestScheduler()
        self.clock_is_ahead = timedelta(0)
        self.rejections: list[str] = []

    def set_clock(self, at: float, by: float) -> None:
        def action(*_: Any) -> None:
            self.clock_is_ahead += timedelta(seconds=by)

        self.scheduler.schedule_absolute(at, action)

    def run(
        self,
        commands: list[tuple[float, str, float]],
        presences: list[tuple[float, float]],
        until: float = 60.0,
    ) -> list[tuple[float, str]]:
        """Return the states and when they change; commands and presences have their arrival first."""
        return changes(self.states(commands, presences, until))

    def states(
        self,
        commands: list[tuple[float, str, float]],
        presences: list[tuple[float, float]],
        until: float,
        *,
        repeat: float = 0.1,
    ) -> list[tuple[float, str]]:
        self.commands = self.scheduler.create_hot_observable(
            *(on_next(at, Timestamp(command, at_time(source))) for at, command, source in commands)
        )
        self.presences = self.scheduler.create_hot_observable(
            *(on_next(at, Timestamp("presence", at_time(stamp))) for at, stamp in presences)
        )
        results = self.scheduler.start(
            lambda: engine_state(
                turns(
                    self.commands.map(lambda it: Command(self.scheduler.now, self._age(it), it.value)),
                    self.presences.map(lambda it: Presence(self.scheduler.now, self._age(it))),
                    Parameters(repeat=repeat),
                )
            ),
            created=0.001,
            subscribed=0.002,
            disposed=until,
        )
        emitted = [(message.time, message.value.value) for message in results.messages]
        self.rejections = [item.reason for _, item in emitted if isinstance(item, Rejected)]
        return [(time, item) for time, item in emitted if not isinstance(item, Rejected)]

    def _age(self, item: Timestamp[str]) -> float:
        return (self.scheduler.now + self.clock_is_ahead - item.timestamp).total_seconds()


def changes(states: list[tuple[float, str]]) -> list[tuple[float, str]]:
    return [
        state for before, state in zip([(0.0, ""), *states], states, strict=False) if state[1] != before[1]
    ]


def seen_until(end: float, begin: float = 0.5) -> list[tuple[float, float]]:
    """The presences of an operator: two a second, each 0.1 s old."""
    return [(step / 2, step / 2 - 0.1) for step in range(int(begin * 2), int(end * 2) + 1)]


@pytest.fixture
def engines() -> Engines:
    return Engines()


def test_engines_start_off_and_the_state_is_repeated(engines: Engines) -> None:
    assert engines.states([], [], 0.35) == [(0.002, OFF), (0.102, OFF), (0.202, OFF), (0.302, OFF)]
    assert engines.commands.subscriptions == [subscribe(0.002, 0.35)]
    assert engines.presences.subscriptions == [subscribe(0.002, 0.35)]


def test_commands_are_obeyed_at_once_with_the_operator_present(engines: Engines) -> None:
    states = engines.run([(2.2, TURN_ON, 2.2), (5.7, TURN_OFF, 5.7)], seen_until(9))

    assert states == [(0.002, OFF), (2.2, ON), (5.7, OFF)]
    assert engines.rejections == []


def test_turn_on_is_refused_if_the_operator_was_seen_too_long_ago(engines: Engines) -> None:
    assert engines.run([(4.0, TURN_ON, 4.0)], seen_until(3)) == [(0.002, OFF)]
    assert engines.rejections == ["turn_on refused: no operator seen for 1.100 s"]


def test_turn_on_that_waited_in_a_queue_is_refused(engines: Engines) -> None:
    assert engines.run([(4.2, TURN_ON, 2.2)], seen_until(9)) == [(0.002, OFF)]
    assert engines.rejections == ["turn_on refused: 2.000 s old"]


def test_engines_turn_off_for_good_10_s_after_the_last_presence(engines: Engines) -> None:
    states = engines.run([(2.2, TURN_ON, 2.2)], [*seen_until(5), *seen_until(30, begin=16)])

    assert states == [(0.002, OFF), (2.2, ON), (14.902, OFF)]


def test_late_presence_is_as_old_as_its_stamp(engines: Engines) -> None:
    states = engines.run([(2.2, TURN_ON, 2.2)], [*seen_until(3), (11.0, 3.4)])

    assert states == [(0.002, OFF), (2.2, ON), (13.402, OFF)]


def test_presence_from_the_future_or_the_past_counts_for_nothing(engines: Engines) -> None:
    states = engines.run([(2.2, TURN_ON, 2.2)], [*seen_until(3), (4.0, 5.0), (5.0, 2.9), (6.0, 1.5)])

    assert states == [(0.002, OFF), (2.2, ON), (12.902, OFF)]
    assert engines.rejections == ["it is stamped by a clock that is 1.000 s ahead of ours"]


@pytest.mark.parametrize("ahead", [0.003, 0.049])
def test_operator_whose_clock_is_slightly_ahead_is_seen(engines: Engines, ahead: float) -> None:
    presences = [(at, at + ahead) for at, _ in seen_until(3)]

    states = engines.run([(2.2, TURN_ON, 2.2)], presences)

    assert states == [(0.002, OFF), (2.2, ON), (13.002, OFF)]
    assert engines.rejections == []


@pytest.mark.parametrize("hours", [1.0, -1.0])
def test_setting_the_clock_changes_nothing(engines: Engines, hours: float) -> None:
    engines.set_clock(4.25, by=hours * 3600)
    presences = [(at, stamp + hours * 3600 * (at > 4.25)) for at, stamp in seen_until(20)]

    states = engines.run([(2.2, TURN_ON, 2.2)], presences, until=45.0)

    assert states == [(0.002, OFF), (2.2, ON), (29.902, OFF)]


@pytest.mark.parametrize(("at", "pause"), [(10.1, 5.0), (10.9, 0.29)])
def test_pause_across_timeout_turns_off(engines: Engines, at: float, pause: float) -> None:
    engines.scheduler.schedule_absolute(at, lambda *_: engines.scheduler.sleep(pause))
    states = engines.states([(1.2, TURN_ON, 1.2)], [(1.0, 1.0)], 20.0)
    assert ON in {state for time, state in states if time < at + 0.05}
    assert {state for time, state in states if time > at + 0.05} == {OFF}


def test_pause_longer_than_the_drive_timeout_turns_off(engines: Engines) -> None:
    engines.scheduler.schedule_absolute(5.1, lambda *_: engines.scheduler.sleep(0.31))
    states = engines.states([(1.2, TURN_ON, 1.2)], seen_until(20), 20.0)
    assert {state for time, state in states if 1.3 < time < 5.15} == {ON}
    assert {state for time, state in states if time > 5.15} == {OFF}


def test_turn_on_that_waited_during_a_pause_is_not_undone() -> None:
    paused = latch(OFF, 99.5, NOW - 1.5)
    on = step(paused, command(TURN_ON, 0.2))
    assert step(on, Tick(at_time(NOW + 0.001))).engines == ON


def test_pause_shorter_than_the_drive_timeout_changes_nothing(engines: Engines) -> None:
    engines.scheduler.schedule_absolute(5.1, lambda *_: engines.scheduler.sleep(0.29))
    assert engines.run([(1.2, TURN_ON, 1.2)], seen_until(12), 12.0) == [(0.002, OFF), (1.2, ON)]


def test_engines_are_off_after_a_restart(engines: Engines) -> None:
    assert engines.run([], seen_until(30)) == [(0.002, OFF)]


def test_state_waits_for_nothing_that_is_scheduled() -> None:
    commands, presences = Subject[Command](), Subject[Presence]()
    found: list[Any] = []
    scheduler = TestScheduler()
    engine_state(turns(commands, presences)).subscribe(found.append, scheduler=scheduler)
    scheduler.advance_to(0.05)
    found.clear()
    presences.on_next(presence(0.0))
    commands.on_next(command(TURN_ON))
    commands.on_next(command(TURN_OFF))
    assert found == [ON, OFF]


def test_clocks_are_compared_before_the_first_command() -> None:
    at_once = ImmediateScheduler.singleton()
    found: list[Event] = []
    first, then = Comparison(at_time(NOW), "one is wrong"), command(TURN_ON)
    latched = turns(rx.just(then, at_once), rx.never(), comparisons=rx.just(first, at_once))
    scheduler = TestScheduler()
    latched.map(lambda turn: turn.event).subscribe(found.append, scheduler=scheduler)
    scheduler.advance_to(0.05)
    assert found[:2] == [first, then]


def test_presence_after_the_timeout_is_too_late(engines: Engines) -> None:
    states = engines.run([(1.6, TURN_ON, 1.6)], [(1.45, 1.45), (11.48, 11.48)], 20.0)

    assert states == [(0.002, OFF), (1.6, ON), (11.48, OFF)]


@pytest.mark.parametrize("repeat", [0.02, 0.1, 0.2])
@pytest.mark.parametrize("lag", [0.0, CLOCK_TOLERANCE])
def test_drive_stops_within_10_45_s_whenever_the_controller_dies(repeat: float, lag: float) -> None:
    sign_of_life = 1.0
    arrival = sign_of_life + lag  # a presence that seems new, as the operator's clock is ahead by as much
    stops = []
    for death in (10.9 + n / 100 for n in range(40)):
        states = Engines().states([(1.1, TURN_ON, 1.1)], [(arrival, arrival)], death, repeat=repeat)
        (*_, (last_on, _)) = [state for state in states if state[1] == ON]
        (*_, (last_time, last)) = states
        stops.append(last_time if last == OFF else last_on + DRIVE_TIMEOUT)

    assert max(stops) <= sign_of_life + 10.45
    assert max(stops) > sign_of_life + 10.0


times = st.floats(0.01, 25.0)


@given(
    st.lists(st.tuples(times, st.sampled_from([TURN_ON, TURN_OFF]), st.floats(-20.0, 1.0)), max_size=8),
    st.lists(st.tuples(times, st.floats(-20.0, 1.0) | st.floats(-0.1, 0.1)), max_size=40),
)
def test_engines_are_never_on_without_presence_or_against_a_command(
    commands: list[tuple[float, str, float]], presences: list[tuple[float, float]]
) -> None:
    arrived = [(at, at + lag) for at, lag in sorted(presences)]
    ordered = [(at, command, at + lag) for at, command, lag in sorted(commands)]
    seen = [(at, min(at, stamp)) for at, stamp in arrived if stamp <= at + CLOCK_TOLERANCE + 1e-5]

    emitted = Engines().states(ordered, arrived, 40.0, repeat=0.2)

    for time, state in emitted:
        if state == ON:
            assert time - max(stamp for at, stamp in seen if at <= time) < 10.0 + 1e-5
    states = changes(emitted)
    for (begin, state), (end, _) in zip(states, [*states[1:], (40.0, OFF)], strict=True):
        if state == ON:
            assert any(abs(begin - at) < 1e-6 and command == TURN_ON for at, command, _ in ordered)
            assert any(at <= begin and begin - 1.0 - 1e-5 <= stamp for at, stamp in seen)
            within = [command for at, command, _ in ordered if begin + 1e-6 < at < end - 1e-6]
            assert TURN_OFF not in within
            lasting = [stamp for at, stamp in seen if at < end]
            assert end - max(lasting) <= 10.0 + 0.2 + 1e-5  # at the next tick
    assert states[0][1] == OFF
