"""Scenarios: what they mean, how they are played, and which mistakes are found."""

from __future__ import annotations

import math
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import pytest
import reactivex as rx
from reactivex.testing import ReactiveTest, TestScheduler

from interfaces.scenario.playback import follow, play
from interfaces.scenario.scenario_file import Scenario, load
from interfaces.scenario.timeline import Events, Sweep
from interfaces.service import UserError
from interfaces.topics import TURN_ON

on_next, on_completed, subscribe = ReactiveTest.on_next, ReactiveTest.on_completed, ReactiveTest.subscribe

SCENARIOS = Path(__file__).parents[2] / "deploy" / "scenarios"


def loaded(tmp_path: Path, text: str) -> Scenario:
    path = tmp_path / "scenario.yaml"
    path.write_text(text)
    return load(path)


def played(scheduler: TestScheduler, timeline: Any, elapsed: float = 0.0, **options: Any) -> list[Any]:
    results = scheduler.start(lambda: play(timeline, elapsed, **options), disposed=220.0)
    return [
        (message.time - 200, message.value.value) for message in results.messages if message.value.kind == "N"
    ]


def test_every_scenario_that_comes_with_the_system_is_sound() -> None:
    assert [load(path) for path in sorted(SCENARIOS.glob("*.yaml"))]


def test_all_that_a_scenario_can_say(tmp_path: Path) -> None:
    scenario = loaded(
        tmp_path,
        """
        l1: 2.0
        theta1: {center: 0.8, amplitude: 0.5, period: 12.0, rate: 50, phase: 1.5, delay: 0.01}
        theta2: [{at: 1.5, value: 0.8}, {at: 4.0, value: 1.8}]
        operator: {pressed: [{from: 0.0, to: 40.0}, {from: 50.0}], heartbeats: [1.942, 1.991]}
        engines: [{at: 5.0, command: turn_on}]
        """,
    )

    assert scenario == Scenario(
        {
            "l1": Events(((0.0, 2.0),)),
            "theta1": Sweep(0.8, 0.5, 12.0, rate=50.0, phase=1.5, delay=0.01),
            "theta2": Events(((1.5, 0.8), (4.0, 1.8))),
        },
        Events(((0.0, True), (40.0, False), (50.0, True))),
        Events(((1.942, True), (1.991, True))),
        Events(((5.0, TURN_ON),)),
    )


def test_an_empty_scenario_drives_nothing(tmp_path: Path) -> None:
    assert loaded(tmp_path, "") == Scenario()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "l3: 1.0",
            "scenario: unknown key 'l3', must be one of engines, l1, l2, operator, repeat, theta1, theta2",
        ),
        (
            "- 1",
            "scenario: must be a mapping with engines, l1, l2, operator, repeat, theta1, theta2, not [1]",
        ),
        ("l1: -1.0", "l1: -1.0 is negative"),
        ("l1: .nan", "l1: must be finite, not nan"),
        ("theta1: yes", "theta1: must be a number, not True"),
        ("theta1: fast", "theta1: must be a number, not 'fast'"),
        ("theta1: []", "theta1: is empty"),
        ("theta1: [{at: 1.0}]", "theta1[0]: lacks 'value'"),
        ("theta1: [{at: -1, value: 0}]", "theta1[0].at: must be at least 0, not -1"),
        ("l1: [{at: 0, value: 1}, {at: 1, value: -2}]", "l1[1].value: -2.0 is negative"),
        ("l1: [{at: 2, value: 1}, {at: 1, value: 1}]", "l1[1]: comes at 1 s, before the one in front of it"),
        ("l1: {center: 1, amplitude: 2, period: 3}", "l1.amplitude: at its lowest, -1.0 is negative"),
        ("l1: {center: 1, amplitude: 1, period: 0}", "l1.period: must be more than 0, not 0"),
        (
            "l1: {center: 1, amplitude: 1, period: 1, rate: 1.0e+9}",
            "l1.rate: must be at most 1000, not 1e+09",
        ),
        (
            "l1: {centre: 1}",
            "l1: unknown key 'centre', must be one of amplitude, center, delay, period, phase, rate",
        ),
        ("operator: {pressed: true}", "operator.pressed: must be a list, not True"),
        ("operator: {pressed: [{from: 2, to: 1}]}", "operator.pressed[0].to: must be more than 2, not 1"),
        (
            "operator: {pressed: [{from: 0}, {from: 9}]}",
            "operator.pressed[1]: comes after one that lasts for ever",
        ),
        (
            "operator: {let_go: {every: 9, for: 1}}",
            "operator.let_go: needs `pressed`: there is nothing to let go of",
        ),
        (
            "operator: {pressed: [{from: 0}], let_go: {every: 1, for: 1}}",
            "operator.let_go.for: must be less than `every`, 1 s",
        ),
        ("operator: {heartbeats: [1, x]}", "operator.heartbeats[1]: must be a number, not 'x'"),
        ("engines: [{at: 1, command: stop}]", "engines[0].command: must be turn_on or turn_off, not 'stop'"),
        (
            "{engines: [{at: 9, command: turn_on}], repeat: 5}",
            "engines: lasts until 9 s, but all starts again after 5 s",
        ),
        ("repeat: 0", "repeat: must be more than 0, not 0"),
        ("l1: [1", "line 1, column 7: expected ',' or ']', but got '<stream end>'"),
        ("l1: 2\nl1: 3", "line 2, column 1: the key l1 appears twice"),
    ],
)
def test_a_mistake_is_one_line_with_file_key_and_reason(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(UserError) as raised:
        loaded(tmp_path, text)

    message = str(raised.value)
    assert message.startswith(f"{tmp_path / 'scenario.yaml'}: {reason}")
    assert "\n" not in message


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"nowhere\.yaml: No such file or directory"):
        load(tmp_path / "nowhere.yaml")


def test_events_are_played_at_their_times(scheduler: TestScheduler) -> None:
    events = Events(((0.0, "a"), (1.0, "b"), (1.5, "c"), (1.5, "d")))

    assert played(scheduler, events) == [(0, "a"), (1.0, "b"), (1.5, "c"), (1.5, "d")]


def test_a_restarted_source_says_its_last_value_at_once_and_goes_on(scheduler: TestScheduler) -> None:
    events = Events(((0.0, "a"), (1.0, "b"), (3.0, "c")))

    assert played(scheduler, events, 2.0) == [(0, "b"), (1.0, "c")]


def test_a_restarted_source_does_not_repeat_single_events(scheduler: TestScheduler) -> None:
    events = Events(((0.0, "a"), (1.0, "b"), (3.0, "c")))

    assert played(scheduler, events, 1.5, resume=False) == [(1.5, "c")]


def test_an_event_at_the_origin_is_played_by_a_source_that_starts_there(scheduler: TestScheduler) -> None:
    assert played(scheduler, Events(((0.0, "a"),)), resume=False) == [(0, "a")]


def test_before_the_origin_nothing_happens(scheduler: TestScheduler) -> None:
    assert played(scheduler, Events(((0.0, "a"), (1.0, "b"))), -2.5) == [(2.5, "a"), (3.5, "b")]


def test_a_timeline_repeats_for_ever(scheduler: TestScheduler) -> None:
    events = Events(((0.0, "a"), (3.0, "b")), repeat=5.0)

    assert played(scheduler, events, 4.0)[:5] == [(0, "b"), (1.0, "a"), (4.0, "b"), (6.0, "a"), (9.0, "b")]
    assert events.at(1e9 + 3.5) == "b"


def test_before_its_first_event_a_repeating_timeline_goes_on_with_the_last(scheduler: TestScheduler) -> None:
    events = Events(((1.0, "a"), (3.0, "b")), repeat=5.0)

    assert events.at(0.5) is None
    assert events.at(5.5) == "b"


def test_a_sweep_is_a_sine_at_its_rate_and_goes_on_where_time_is() -> None:
    sweep = Sweep(center=1.0, amplitude=0.5, period=8.0, rate=10.0)

    assert [sweep.at(time) for time in (0, 2, 4, 6)] == pytest.approx([1.0, 1.5, 1.0, 0.5])
    assert [time for time, _ in islice(sweep.after(3.14), 3)] == pytest.approx([3.2, 3.3, 3.4])
    assert all(
        value == pytest.approx(1 + math.sin(math.tau * time / 8) / 2)
        for time, value in islice(sweep.after(3), 9)
    )


def test_a_delayed_sweep_says_the_same_between_the_times_of_another(scheduler: TestScheduler) -> None:
    sweep = Sweep(0.0, 1.0, 8.0, rate=10.0, delay=0.05)

    assert [time for time, _ in islice(sweep.after(3.14), 3)] == pytest.approx([3.15, 3.25, 3.35])


def test_a_sweep_that_was_held_up_does_not_catch_up(scheduler: TestScheduler) -> None:
    times: list[float] = []

    def take(_: float) -> None:
        times.append(scheduler.clock)
        if len(times) == 3:
            scheduler.sleep(1.03)

    play(Sweep(0.0, 1.0, 8.0, rate=10.0), 0.0).subscribe(take, scheduler=scheduler)
    scheduler.advance_to(2.0)

    assert times[:6] == pytest.approx([0.0, 0.1, 0.2, 1.3, 1.4, 1.5])


def test_events_that_were_held_up_are_all_played(scheduler: TestScheduler) -> None:
    values: list[str] = []

    def take(value: str) -> None:
        values.append(value)
        scheduler.sleep(1.0)

    play(Events(((0.5, "a"), (0.6, "b"), (0.7, "c"))), 0.0).subscribe(take, scheduler=scheduler)
    scheduler.advance_to(9.0)

    assert values == ["a", "b", "c"]


def test_an_operator_lets_go_now_and_then(tmp_path: Path, scheduler: TestScheduler) -> None:
    scenario = loaded(
        tmp_path, "operator: {pressed: [{from: 1, to: 7}, {from: 9}], let_go: {every: 5.0, for: 1.0}}"
    )

    changes = played(scheduler, scenario.pressed)

    pressed = [(time, value) for (_, before), (time, value) in pairwise(changes) if value != before]
    assert pressed == [
        (1, True),
        (4, False),
        (5, True),
        (7, False),
        (10, True),
        (14, False),
        (15, True),
        (19, False),
    ]
    assert changes[0] == (0, False)


@pytest.mark.parametrize("every", [0.7, 5.6, 11.2, 0.1, 1 / 3])
def test_an_operator_lets_go_in_every_round_whatever_the_period(tmp_path: Path, every: float) -> None:
    text = f"operator: {{pressed: [{{from: 0}}], let_go: {{every: {every!r}, for: {every / 4!r}}}}}"
    pressed = loaded(tmp_path, text).pressed
    assert pressed is not None

    changes = list(islice(pressed.after(0.0), 200))

    assert [value for _, value in changes] == [False, True] * 100
    assert all(pressed.at(time) is value for time, value in changes)
    assert [time for time, _ in changes[1::2]] == pytest.approx([every * (n + 1) for n in range(100)])


@pytest.mark.parametrize("repeat", [0.7, 11.2, 0.1, 1 / 3])
def test_each_event_of_each_round_holds_from_its_time_on(repeat: float) -> None:
    events = Events(((0.0, "a"), (repeat / 3, "b"), (repeat / 2, "c")), repeat)

    changes = list(islice(events.after(0.0), 300))

    assert [value for _, value in changes] == [*"bca"] * 100
    assert all(events.at(time) == value for time, value in changes)
    assert all(next(events.after(time)) == after for (time, _), after in pairwise(changes))


def test_a_source_follows_its_parameter_where_no_scenario_drives_it(scheduler: TestScheduler) -> None:
    parameter = rx.merge(rx.just(1.0), scheduler.create_hot_observable(on_next(300, 2.0)))

    assert scheduler.start(lambda: follow(parameter, None)).messages == [on_next(200, 1.0), on_next(300, 2.0)]


def test_a_source_follows_its_scenario_until_its_parameter_is_set(scheduler: TestScheduler) -> None:
    parameter = rx.merge(rx.just(1.0), scheduler.create_hot_observable(on_next(300, 2.0)))
    timeline = scheduler.create_hot_observable(on_next(250, 7.0), on_next(350, 8.0), on_completed(360))

    results = scheduler.start(lambda: follow(parameter, timeline))

    assert results.messages == [on_next(250, 7.0), on_next(300, 2.0)]
    assert timeline.subscriptions == [subscribe(200, 300)]
