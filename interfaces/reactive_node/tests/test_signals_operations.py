"""The operations of signals are those of plain functions of time."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st
from reactivex import Observable, never
from reactivex.notification import OnError

from interfaces.reactive_node.tests.arrivals import (
    LATENESS,
    MS,
    SECOND,
    Arrival,
    answers,
    arrivals,
    arriving,
    items,
)
from reactive_node.signals import (
    CERTAIN,
    EXTRAPOLATED,
    HELD,
    UNKNOWN,
    Answer,
    Extrapolated,
    Held,
    Refused,
    Signal,
    constant,
    hold,
    lift,
    linear,
    of_time,
    switch,
)
from reactive_node.stamps import Timestamp
from reactive_node.testing import VirtualTime

GAP = 0.3  # s

Value = tuple[Any, int]
Function = Callable[[int], Value]


def meaning(scheduler: VirtualTime, samples: list[Arrival]) -> tuple[Signal[float], Function]:
    """Return a signal of samples, and the plain function that it is (tested in test_signals_samples.py)."""

    signal = linear(arriving(scheduler, samples), lateness=LATENESS, gap=GAP, silence=Held())

    @cache
    def at(time: int) -> Value:
        before = [each for each in samples if each.time <= time]
        after = [each for each in samples if each.time > time]
        if not before:
            return None, UNKNOWN
        a = before[-1]
        if a.time == time:
            return a.value, CERTAIN
        if not after or after[0].time - a.time > GAP * SECOND:
            return a.value, HELD
        b = after[0]
        return a.value + (b.value - a.value) * ((time - a.time) / (b.time - a.time)), CERTAIN

    return signal, at


def lifted(function: Callable[..., Any], *values: Value) -> Value:
    marks = [mark for _, mark in values]
    if UNKNOWN in marks:
        return None, UNKNOWN
    return function(*(value for value, _ in values)), max(marks)


def check(found: list[Answer[Any]], at: Function, count: int = 55) -> None:
    assert len(found) >= count
    for time, value, mark in found:
        expected, expected_mark = at(time)
        assert mark == expected_mark
        assert value == (pytest.approx(expected, abs=1e-6, rel=1e-9) if mark != UNKNOWN else None)


# Functions and arithmetic


@given(arrivals(), arrivals())
def test_lift_applies_a_function_at_each_time(one: list[Arrival], other: list[Arrival]) -> None:
    scheduler = VirtualTime()
    (a, f), (b, g) = meaning(scheduler, one), meaning(scheduler, other)

    found = answers(scheduler, lift(lambda p, q: (p, q))(a, b))

    check(found, lambda time: lifted(lambda p, q: (p, q), f(time), g(time)))


@pytest.mark.parametrize(
    ("make", "value"),
    [
        (lambda a, b: a + b, 10.0),
        (lambda a, b: a - b, 6.0),
        (lambda a, b: a * b, 16.0),
        (lambda a, b: a / b, 4.0),
        (lambda a, b: -a, -8.0),
        (lambda a, b: a + 1, 9.0),
        (lambda a, b: 1 + a, 9.0),
        (lambda a, b: a - 1, 7.0),
        (lambda a, b: 1 - a, -7.0),
        (lambda a, b: a * 3, 24.0),
        (lambda a, b: 3 * a, 24.0),
        (lambda a, b: a / 2, 4.0),
        (lambda a, b: 2 / a, 0.25),
    ],
)
def test_arithmetic_is_that_of_the_values(
    scheduler: VirtualTime, make: Callable[[Any, Any], Signal[float]], value: float
) -> None:
    assert answers(scheduler, make(constant(8.0), constant(2.0)))[0].value == value


def test_lift_passes_the_weakest_mark_on(scheduler: VirtualTime) -> None:
    samples = [Arrival(0, 0.0, 0), Arrival(200 * MS, 2.0, 0)]
    weaker = linear(arriving(scheduler, samples), lateness=LATENESS, gap=GAP, silence=Extrapolated(0.2))
    held = linear(arriving(scheduler, samples), lateness=LATENESS, gap=GAP, silence=Held())

    found = answers(scheduler, lift(lambda a, b, c: a + b + c)(held, 1.0, weaker), 0.1)

    assert found[2] == Answer(200 * MS, 5.0)
    assert found[4] == Answer(400 * MS, pytest.approx(7.0), EXTRAPOLATED)
    assert found[5] == Answer(500 * MS, None, UNKNOWN)


def test_signal_in_common_is_evaluated_once(scheduler: VirtualTime) -> None:
    samples = arriving(scheduler, [Arrival(0, 2.0, 0)])
    signal = hold(samples, lateness=LATENESS)

    assert answers(scheduler, signal * signal)[0].value == 4.0
    assert len(samples.subscriptions) == 1


def test_function_of_time_is_known_at_once(scheduler: VirtualTime) -> None:
    recording = scheduler.record(of_time(lambda time: time / SECOND).sample(0.25), until=1.0)

    assert recording.items == [(t, Answer(round(t * SECOND), t)) for t in (0.0, 0.25, 0.5, 0.75, 1.0)]


# Tuples


class Pair(NamedTuple):
    x: float
    y: tuple[float, ...]


@pytest.mark.parametrize(
    ("make", "value"),
    [
        (lambda s: s.derivative(0.1), Pair(10.0, (-20.0,))),
        (lambda s: s.integral(0.1), Pair(0.2, (-0.4,))),
    ],
)
def test_results_have_the_structure_of_the_values(
    scheduler: VirtualTime, make: Callable[[Signal[Any]], Signal[Any]], value: Pair
) -> None:
    moving = of_time(lambda time: Pair(10.0 * time / SECOND, (-20.0 * time / SECOND,)))

    _, _, found, *_ = answers(scheduler, make(moving), 0.1)

    assert type(found.value) is Pair
    assert (found.value.x, *found.value.y) == pytest.approx((value.x, *value.y))


@pytest.mark.parametrize(
    "make",
    [
        lambda samples: linear(samples, lateness=LATENESS, gap=GAP),
        lambda samples: hold(samples, lateness=LATENESS).derivative(0.1),
        lambda samples: hold(samples, lateness=LATENESS).integral(0.05),
    ],
    ids=["linear", "derivative", "integral"],
)
def test_tuple_that_changes_its_length_is_an_error(
    scheduler: VirtualTime, make: Callable[[Any], Signal[Any]]
) -> None:
    samples = arriving(scheduler, [Arrival(0, (1.0, 2.0), 0), Arrival(200 * MS, (1.0,), 0)])

    *_, end = scheduler.record(make(samples).sample(0.01), until=1.5).messages

    assert isinstance(end.value, OnError)
    assert "zip()" in str(end.value.exception)


# Time


@pytest.mark.parametrize("delay", [0.05, 0.0, -0.05])
@given(samples=arrivals())
def test_delay_moves_time(delay: float, samples: list[Arrival]) -> None:
    scheduler = VirtualTime()
    signal, f = meaning(scheduler, samples)

    check(answers(scheduler, signal.delay(delay)), lambda time: f(time - round(delay * SECOND)))


@pytest.mark.parametrize("over", [0.02, 0.1])
@given(samples=arrivals())
def test_derivative_is_the_mean_rate_of_change(over: float, samples: list[Arrival]) -> None:
    scheduler = VirtualTime()
    signal, f = meaning(scheduler, samples)
    half = round(over * SECOND / 2)

    check(
        answers(scheduler, signal.derivative(over)),
        lambda time: lifted(lambda p, q: (q - p) / over, f(time - half), f(time + half)),
    )


@given(arrivals(), st.integers(7, 40), st.sampled_from([0.017, 0.05]))
def test_integral_is_the_sum_of_trapezoids(samples: list[Arrival], step: int, period: float) -> None:
    scheduler = VirtualTime()
    signal, f = meaning(scheduler, samples)
    step *= MS

    def integral(time: int) -> Value:
        knots = [at for at in range(0, time + 1, step) if f(at)[1] != UNKNOWN]
        if not knots:
            return None, UNKNOWN
        knots.append(time)
        parts = [(f(p)[0] + f(q)[0]) / 2 * (q - p) / SECOND for p, q in pairwise(knots)]
        return math.fsum(parts), max(f(at)[1] for at in knots)

    check(answers(scheduler, signal.integral(step / SECOND), period), integral, count=20)


def test_integral_is_unknown_after_an_unknown_value(scheduler: VirtualTime) -> None:
    samples = [Arrival(time * MS, 1.0, 0) for time in (0, 200, 400, 900, 1100)]
    signal = linear(arriving(scheduler, samples), lateness=LATENESS, gap=GAP)

    found = answers(scheduler, signal.integral(0.1), 0.1)

    assert [each.value for each in found[:5]] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert {each.mark for each in found[5:]} == {UNKNOWN}


def test_integral_keeps_what_it_needs(scheduler: VirtualTime) -> None:
    """Its steps are long, and an earlier sum is asked for later."""
    samples = arriving(scheduler, [Arrival(k * MS, 2.0 * k, 0) for k in range(1500)])
    integral = linear(samples, lateness=LATENESS, gap=GAP).integral(0.2)

    for time, value, mark in answers(
        scheduler, lift(lambda *both: both)(integral.delay(0.25), integral), 0.01
    ):
        t = time / MS
        assert (mark == UNKNOWN) == (t < 250)
        assert mark == UNKNOWN or value == pytest.approx(((t - 250) ** 2 / 1000, t**2 / 1000))


def test_integral_begins_with_the_subscription(scheduler: VirtualTime) -> None:
    integral = constant(1.0).integral(0.1)

    found = answers(scheduler, integral + integral.delay(0.3), 0.1)

    assert [each.mark for each in found[:4]] == [UNKNOWN] * 3 + [CERTAIN]
    assert found[5].value == pytest.approx(0.5 + 0.2)


def test_integral_of_an_integral(scheduler: VirtualTime) -> None:
    twice = constant((2.0, 4.0)).integral(0.01).integral(0.01)

    x, y = answers(scheduler, twice, 0.5, until=3.0)[-1].value

    assert (x, y) == pytest.approx((9.0, 18.0))


@given(arrivals())
def test_window_holds_the_values_before(samples: list[Arrival]) -> None:
    scheduler = VirtualTime()
    signal, f = meaning(scheduler, samples)
    times = (30 * MS, 20 * MS, 10 * MS, 0)

    check(
        answers(scheduler, signal.window(0.03, 0.01)),
        lambda time: lifted(lambda *found: found, *(f(time - back) for back in times)),
    )


# Events


def keys(names: str) -> st.SearchStrategy[list[Arrival]]:
    return arrivals(st.sampled_from(names), size=6)


@given(keys("abc"), arrivals(), arrivals())
def test_switch_chooses_by_events(events: list[Arrival], one: list[Arrival], other: list[Arrival]) -> None:
    scheduler = VirtualTime()
    (a, f), (b, g) = meaning(scheduler, one), meaning(scheduler, other)
    key = hold(arriving(scheduler, events), lateness=LATENESS)

    def chosen(time: int) -> Value:
        before = [each.value for each in events if each.time <= time]
        return {"a": f, "b": g}[before[-1]](time) if before and before[-1] != "c" else (None, UNKNOWN)

    check(answers(scheduler, switch(key, {"a": a, "b": b})), chosen)


def test_switch_without_a_key_chooses_nothing(scheduler: VirtualTime) -> None:
    choices = {None: constant(1.0)}

    found = answers(scheduler, switch(hold(scheduler.hot(), lateness=LATENESS), choices))

    assert {(each.value, each.mark) for each in found} == {(None, UNKNOWN)}


@given(keys("x"), arrivals(), arrivals())
def test_until_the_first_event(events: list[Arrival], one: list[Arrival], other: list[Arrival]) -> None:
    scheduler = VirtualTime()
    (a, f), (b, g) = meaning(scheduler, one), meaning(scheduler, other)
    event = hold(arriving(scheduler, events), lateness=LATENESS)
    first = events[0].time if events else math.inf

    check(answers(scheduler, a.until(event, b)), lambda time: f(time) if time < first else g(time))


@given(arrivals(st.integers()), arrivals())
def test_snapshot_takes_the_values_at_events(events: list[Arrival], samples: list[Arrival]) -> None:
    scheduler = VirtualTime()
    signal, f = meaning(scheduler, samples)

    found = items(scheduler, signal.snapshot(arriving(scheduler, events), lateness=LATENESS))

    assert [event for event, _ in found] == [each.value for each in events]
    assert [answer.time for _, answer in found] == [each.time for each in events]
    check([answer for _, answer in found], f, count=0)


def test_late_event_is_dropped_and_reported(scheduler: VirtualTime) -> None:
    refused: list[Refused] = []
    events = arriving(scheduler, [Arrival(100 * MS, "a", 200 * MS), Arrival(300 * MS, "b", 0)])
    taken = constant(1.0).snapshot(events, lateness=LATENESS, refused=refused.append)

    assert items(scheduler, taken) == [("b", Answer(300 * MS, 1.0))]
    assert refused == [Refused(100 * MS, "a", "it is 0.200 s late", is_first=True)]


def test_events_at_one_time_all_take_the_value(scheduler: VirtualTime) -> None:
    events = arriving(scheduler, [Arrival(MS, "a", 0), Arrival(MS, "b", 0)])

    taken = items(scheduler, constant(1.0).snapshot(events, lateness=LATENESS))

    assert taken == [("a", Answer(MS, 1.0)), ("b", Answer(MS, 1.0))]


def test_what_a_waiting_event_needs_is_kept(scheduler: VirtualTime) -> None:
    fast = arriving(scheduler, [Arrival(k * MS, k, 0) for k in range(1, 1000)])
    slow = arriving(scheduler, [Arrival(0, 0.0, 0), Arrival(900 * MS, 9.0, 0)])
    pairs = lift(lambda *pair: pair)(hold(fast, lateness=LATENESS), linear(slow, lateness=LATENESS, gap=1.0))

    found = items(
        scheduler, pairs.snapshot(arriving(scheduler, [Arrival(50 * MS, "a", 0)]), lateness=LATENESS)
    )

    assert found == [("a", Answer(50 * MS, (50, pytest.approx(0.5))))]


# Crossings


def changes(scheduler: VirtualTime, observable: Observable[Timestamp[bool]]) -> list[tuple[bool, int]]:
    return [tuple(item) for item in items(scheduler, observable)]


@given(arrivals(st.floats(0.0, 1.0)))
def test_when_finds_the_changes_to_the_nanosecond(samples: list[Arrival]) -> None:
    scheduler = VirtualTime()
    signal, f = meaning(scheduler, samples)
    was_true = False

    for is_true, time in changes(scheduler, signal.when(lambda value: value > 0.5, resolution=0.001)):
        assert is_true != was_true
        assert f(time)[1] == CERTAIN
        assert (f(time)[0] > 0.5) == is_true
        before, mark = f(time - 1)
        assert mark != CERTAIN or (before > 0.5) == was_true
        was_true = is_true


@given(arrivals(st.floats(0.0, 1.0)))
def test_when_misses_no_change_longer_than_its_resolution(samples: list[Arrival]) -> None:
    scheduler = VirtualTime()
    signal, f = meaning(scheduler, samples)

    found = changes(scheduler, signal.when(lambda value: value > 0.5, resolution=0.001))

    state = False
    for time in range(0, 1000 * MS, MS):
        value, mark = f(time)
        state = value > 0.5 if mark == CERTAIN else state
        assert ([is_true for is_true, at in found if at <= time] or [False])[-1] == state


def test_when_finds_a_crossing_long_before_it_looks(scheduler: VirtualTime) -> None:
    samples = arriving(scheduler, [Arrival(k * MS, k, 0) for k in range(1, 1000)])
    signal = hold(samples, lateness=LATENESS)

    found = changes(scheduler, signal.when(lambda value: value >= 210, resolution=0.2))

    assert found == [(True, 210 * MS)]


@pytest.mark.parametrize(
    ("what", "make"),
    [
        ("the period", lambda s: s.sample(0.0)),
        ("the resolution", lambda s: s.when(bool, resolution=-1.0)),
        ("the step", lambda s: s.integral(0.0)),
        ("the step", lambda s: s.window(1.0, 0.0)),
        ("half the time of a derivative", lambda s: s.derivative(1e-10)),
        ("the lateness", lambda s: s.snapshot(never(), lateness=0.0)),
        ("the lateness", lambda s: hold(never(), lateness=0.0)),
        ("the lateness", lambda s: linear(never(), lateness=0.0, gap=1.0)),
        ("the gap", lambda s: linear(never(), lateness=1.0, gap=-1.0)),
    ],
)
def test_durations_must_be_positive(what: str, make: Callable[[Signal[float]], Any]) -> None:
    with pytest.raises(ValueError, match=f"^{what} must be more than 0 s, not .* s$"):
        make(constant(1.0))
