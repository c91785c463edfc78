"""Signals from samples: their values are those of plain functions, however late the samples arrive."""

from __future__ import annotations

import math
from functools import partial
from itertools import zip_longest
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped
from hypothesis import given
from hypothesis import strategies as st
from std_msgs.msg import Header

from interfaces.reactive_node.tests.arrivals import (
    LATENESS,
    MS,
    SECOND,
    Arrival,
    answers,
    arrivals,
    arriving,
)
from reactive_node.signals import (
    CERTAIN,
    EXTRAPOLATED,
    HELD,
    UNKNOWN,
    Answer,
    Extrapolated,
    Held,
    Nothing,
    Refused,
    Silence,
    Unchanged,
    constant,
    hold,
    interpolate,
    linear,
    of_time,
    slerp,
)
from reactive_node.stamps import UNSTAMPED, by_header
from reactive_node.testing import VirtualTime

GAP = 0.06  # s
GAP_NS = round(GAP * SECOND)


def held(samples: list[Arrival], time: int) -> tuple[Any, int]:
    before = [sample for sample in samples if sample.time <= time]
    return (before[-1].value, CERTAIN) if before else (None, UNKNOWN)


def straight(samples: list[Arrival], time: int, silence: Silence) -> tuple[Any, int]:
    before = [sample for sample in samples if sample.time <= time]
    after = [sample for sample in samples if sample.time > time]
    if not before:
        return None, UNKNOWN
    a = before[-1]
    if a.time == time:
        return a.value, CERTAIN
    if after and after[0].time - a.time <= GAP_NS:
        b = after[0]
        return a.value + (b.value - a.value) * ((time - a.time) / (b.time - a.time)), CERTAIN
    match silence:
        case Unchanged():
            is_rest = time >= a.time + GAP_NS and (not after or time < after[0].time - GAP_NS)
            return a.value, CERTAIN if is_rest else HELD
        case Held():
            return a.value, HELD
        case Extrapolated(bound):
            if len(before) > 1 and a.time - before[-2].time <= GAP_NS and time - a.time <= bound * SECOND:
                c = before[-2]
                ratio = (time - c.time) / (a.time - c.time)
                return c.value + (a.value - c.value) * ratio, EXTRAPOLATED
    return None, UNKNOWN


def asked(
    scheduler: VirtualTime,
    samples: list[Arrival],
    silence: Silence | None = None,
    period: float = 0.017,
    until: float = 1.5,
) -> tuple[list[Answer[Any]], list[Refused]]:
    """Return the answers of `hold`, or of `linear` with a silence, and what was refused."""
    refused: list[Refused] = []
    make: Any = hold if silence is None else partial(linear, gap=GAP, silence=silence)
    signal = make(arriving(scheduler, samples), lateness=LATENESS, refused=refused.append)
    return answers(scheduler, signal, period, until), refused


@given(arrivals())
def test_hold_is_the_last_value_however_late_it_arrives(samples: list[Arrival]) -> None:
    found, _ = asked(VirtualTime(), samples)

    assert [each.time for each in found[:3]] == [0, 17 * MS, 34 * MS]
    assert found[-1].time >= 1383 * MS
    for time, value, mark in found:
        assert (value, mark) == held(samples, time)


@pytest.mark.parametrize("silence", [Nothing(), Unchanged(), Held(), Extrapolated(0.03)], ids=repr)
@given(samples=arrivals())
def test_linear_is_the_line_between_neighbours(samples: list[Arrival], silence: Silence) -> None:
    found, _ = asked(VirtualTime(), samples, silence)

    assert found[-1].time >= 1323 * MS
    for time, value, mark in found:
        assert (value, mark) == straight(samples, time, silence)


def test_movement_of_two_samples_a_gap_apart_goes_on(scheduler: VirtualTime) -> None:
    found, _ = asked(scheduler, [Arrival(0, 0.0, 0), Arrival(GAP_NS, 6.0, 0)], Extrapolated(GAP), GAP)

    assert found[2] == Answer(2 * GAP_NS, 12.0, EXTRAPOLATED)


def test_linear_follows_the_structure_of_tuples(scheduler: VirtualTime) -> None:
    a = Answer(time=0, value=(0.0, 10.0), mark=4)
    b = Answer(time=8, value=(1.0, 30.0), mark=8)
    samples = arriving(scheduler, [Arrival(0, a, 0), Arrival(SECOND, b, 0)])

    found = answers(scheduler, linear(samples, lateness=LATENESS, gap=1.0), period=0.25)

    assert found[1] == Answer(SECOND // 4, Answer(2.0, (0.25, 15.0), 5.0), CERTAIN)
    assert type(found[1].value) is Answer


Quaternion = tuple[float, float, float, float]


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def about(axis: tuple[float, float, float], angle: float) -> Quaternion:
    """A rotation about an axis [rad]."""
    scale = math.sin(angle / 2) / math.hypot(*axis)
    return axis[0] * scale, axis[1] * scale, axis[2] * scale, math.cos(angle / 2)


axes = st.tuples(st.floats(0.1, 1), st.floats(-1, 1), st.floats(-1, 1))
angles = st.floats(-3.1, 3.1)


@given(axes, angles, axes, angles, st.sampled_from([1, -1]))
def test_slerp_turns_at_constant_speed_the_short_way(
    axis: tuple[float, float, float],
    angle: float,
    other: tuple[float, float, float],
    turn: float,
    sign: int,
) -> None:
    begin = about(axis, angle)
    x, y, z, w = product(begin, about(other, turn))
    scheduler = VirtualTime()
    end = (sign * x, sign * y, sign * z, sign * w)  # the same rotation
    samples = arriving(scheduler, [Arrival(0, begin, 0), Arrival(SECOND, end, 0)])

    found = answers(scheduler, slerp(samples, lateness=LATENESS, gap=1.0), period=0.2)

    assert [each.time for each in found[:5]] == [200 * MS * k for k in range(5)]
    for number, each in enumerate(found[:5]):
        assert each.value == pytest.approx(product(begin, about(other, turn * number / 5)), abs=1e-6)


def test_slerp_knows_silence_and_refuses(scheduler: VirtualTime) -> None:
    refused: list[Refused] = []
    turned = about((0.0, 0.0, 1.0), 1.0)
    samples = arriving(scheduler, [Arrival(0, turned, 0), Arrival(MS, turned, 300 * MS)])
    signal = slerp(samples, lateness=LATENESS, gap=GAP, silence=Held(), refused=refused.append)

    assert answers(scheduler, signal, 0.5)[1] == Answer(SECOND // 2, turned, HELD)
    assert len(refused) == 1


def test_a_user_may_bring_an_interpolation(scheduler: VirtualTime) -> None:
    samples = arriving(scheduler, [Arrival(0, 1.0, 0), Arrival(SECOND, 16.0, 0)])
    signal = interpolate(lambda a, b, ratio: a * (b / a) ** ratio, samples, lateness=LATENESS, gap=1.0)

    assert [each.value for each in answers(scheduler, signal, 0.25)[:5]] == [1.0, 2.0, 4.0, 8.0, 16.0]


# When answers come


def test_a_line_is_answered_when_its_second_sample_is_settled(scheduler: VirtualTime) -> None:
    samples = arriving(scheduler, [Arrival(time * MS, 1.0, 0) for time in range(0, 500, 20)])
    signal = linear(samples, lateness=LATENESS, gap=GAP)

    recording = scheduler.record(signal.sample(0.01), until=0.4)

    waited = [at - answer.time / SECOND for at, answer in recording.items]
    assert min(waited) == pytest.approx(LATENESS)
    assert max(waited) == pytest.approx(LATENESS + 0.01)


def test_a_resting_state_is_answered_after_lateness_and_gap(scheduler: VirtualTime) -> None:
    samples = arriving(scheduler, [Arrival(0, 1.0, 0)])
    signal = linear(samples, lateness=LATENESS, gap=GAP, silence=Unchanged())

    recording = scheduler.record(signal.sample(0.01), until=5.0)

    *_, (at, answer) = recording.items
    assert at - answer.time / SECOND == pytest.approx(LATENESS + GAP, abs=0.0101)
    assert all(answer.is_certain for _, answer in recording.items if answer.time >= GAP_NS)


def test_a_state_that_pauses_for_twice_the_gap_is_held(scheduler: VirtualTime) -> None:
    samples = [Arrival(0, 1.0, 0), Arrival(2 * GAP_NS, 3.0, 0)]

    found, _ = asked(scheduler, samples, Unchanged(), 0.001)

    assert {each.mark for each in found if 0 < each.time < 2 * GAP_NS} == {HELD}


def test_a_held_value_is_answered_after_lateness(scheduler: VirtualTime) -> None:
    signal = hold(arriving(scheduler, [Arrival(0, 1.0, 0)]), lateness=LATENESS)

    recording = scheduler.record(signal.sample(0.5), until=5.0)

    assert [at for at, _ in recording.items] == pytest.approx([0.5 * k + LATENESS for k in range(10)])


# What is refused


def test_late_sample_is_dropped_and_reported(scheduler: VirtualTime) -> None:
    samples = [Arrival(0, 1.0, 0), Arrival(20 * MS, 9.0, 101 * MS), Arrival(40 * MS, 3.0, 0)]

    found, refused = asked(scheduler, samples, Nothing(), 0.02)

    assert found[:3] == [Answer(0, 1.0), Answer(20 * MS, 2.0), Answer(40 * MS, 3.0)]
    assert refused == [Refused(20 * MS, 9.0, "it is 0.101 s late")]


@pytest.mark.parametrize("is_state", [True, False])
def test_late_value_of_a_state_counts_if_it_is_the_newest(scheduler: VirtualTime, is_state: bool) -> None:
    samples = [Arrival(0, 1.0, 0), Arrival(20 * MS, 9.0, 400 * MS)]

    found, refused = asked(scheduler, samples, Unchanged() if is_state else Held(), 0.02)

    taken = 320 * MS + 1 if is_state else None
    assert refused == [Refused(20 * MS, 9.0, "it is 0.400 s late", taken)]
    assert {each.value for each in found if each.time <= 320 * MS} == {1.0}
    assert {each.value for each in found if each.time > 320 * MS} == {9.0 if is_state else 1.0}


@given(arrivals(st.none(), most=400))
def test_late_value_of_a_state_bends_no_line(samples: list[Arrival]) -> None:
    """A certain value is on the line of the movement, or that of a state that rests."""
    moving = [each._replace(value=float(each.time)) for each in samples]

    found, _ = asked(VirtualTime(), moving, Unchanged(), 0.01, until=2.5)

    measured = {each.value for each in moving}
    for time, value, mark in found:
        assert mark != CERTAIN or value in measured or value == pytest.approx(time)


@given(arrivals(most=900))
def test_resting_state_has_its_newest_value_however_late_it_came(samples: list[Arrival]) -> None:
    for silence in (None, Unchanged()):
        (*_, last), _ = asked(VirtualTime(), samples, silence, until=3.0)

        assert last.value == (samples[-1].value if samples else None)


@pytest.mark.parametrize(
    ("pause", "dropped", "held"),
    [(140, range(5, 7), []), (320, range(6, 19), [*range(90, 140), *range(241, 380)])],
)
def test_movement_goes_on_after_late_values(
    scheduler: VirtualTime, pause: int, dropped: range, held: list[int]
) -> None:
    """After 80 ms, the network pauses; then all samples come together. 320 ms look like a rest."""
    delays = [0] * 5 + [max(0, 80 + pause - 20 * k) for k in range(5, 40)]
    ramp = [Arrival(k * 20 * MS, float(k), delay * MS) for k, delay in enumerate(delays)]

    found, refused = asked(scheduler, ramp, Unchanged(), 0.01)

    assert [each.value for each in refused if each.taken is None] == list(dropped)
    uncertain = [each.time // MS for each in found if each.time <= 780 * MS and not each.is_certain]
    assert uncertain == [t for t in held if t % 10 == 0]


@pytest.mark.parametrize(
    ("following", "taken"),
    [
        ([], [120 * MS + 1]),
        ([Arrival(120 * MS, 5.0, 0)], [None]),
        ([Arrival(120 * MS + 1, 5.0, 0)], [120 * MS + 1, 240 * MS + 2]),
        ([Arrival(180 * MS + 1, 5.0, 0)], [120 * MS + 1, 240 * MS + 2]),
        ([Arrival(180 * MS + 2, 5.0, 0)], [120 * MS + 1]),
        ([Arrival(180 * MS, 5.0, 0), Arrival(240 * MS + 1, 6.0, 0)], [120 * MS + 1, None]),
    ],
)
def test_late_value_of_a_state_counts_two_gaps_after_the_sample_before(
    scheduler: VirtualTime, following: list[Arrival], taken: list[int | None]
) -> None:
    """If none follows by then. No line leads to it or from it: what follows within a gap is as late."""
    samples = [Arrival(0, 1.0, 0), Arrival(20 * MS, 9.0, 100 * MS), *following]

    found, refused = asked(scheduler, samples, Unchanged(), 0.001)

    reasons = ["it is 0.100 s late", "it comes right after a late one"]
    assert refused == [
        Refused(sample.time, sample.value, reason, at)
        for sample, reason, at in zip(samples[1:], reasons, taken, strict=False)
    ]
    counting = samples[:1] + [
        sample._replace(time=sample.time if at is None else at)
        for sample, at in zip_longest(samples[1:], taken)
        if sample is samples[-1] or at is not None
    ]
    for time, value, mark in found:
        assert (value, mark) == straight(counting, time, Unchanged())


def test_the_newest_of_several_late_values_counts(scheduler: VirtualTime) -> None:
    late = [Arrival(k * MS, float(k), (400 - k) * MS) for k in range(3)]

    found, refused = asked(scheduler, late, period=0.1)

    assert [each.taken for each in refused] == [300 * MS + k for k in (1, 2, 3)]
    assert [each.value for each in found[3:5]] == [None, 2.0]


def test_the_shortest_lateness_is_a_nanosecond(scheduler: VirtualTime) -> None:
    assert answers(scheduler, hold(scheduler.hot(), lateness=1e-9))[0] == Answer(0, None, UNKNOWN)
    with pytest.raises(ValueError, match=r"^the lateness must be more than 0 s, not 1e-10 s$"):
        hold(scheduler.hot(), lateness=1e-10)


def test_sample_on_its_bound_is_too_late(scheduler: VirtualTime) -> None:
    """The value at that time is settled already."""
    samples = [Arrival(0, 1.0, 0), Arrival(200 * MS, 9.0, 100 * MS), Arrival(250 * MS, 3.0, 0)]

    found, refused = asked(scheduler, samples, period=0.1)

    assert found[2:4] == [Answer(200 * MS, 1.0), Answer(300 * MS, 3.0)]
    assert [each.time for each in refused] == [200 * MS]


def test_late_copy_of_the_last_value_is_dropped(scheduler: VirtualTime) -> None:
    found, refused = asked(scheduler, [Arrival(0, 1.0, 0), Arrival(0, 2.0, 400 * MS)], period=0.1)

    assert {each.value for each in found} == {1.0}
    assert [each.taken for each in refused] == [None]


def test_nothing_that_an_answer_needs_is_forgotten(scheduler: VirtualTime) -> None:
    samples = [Arrival(k * 5 * MS, float(k), 0) for k in range(200)]
    signal = linear(arriving(scheduler, samples), lateness=LATENESS, gap=GAP, silence=Extrapolated(0.2))

    for time, value, mark in answers(scheduler, signal.delay(0.1) + signal, 0.001):
        assert (mark == UNKNOWN) == (not 100 * MS <= time <= 1195 * MS)
        assert mark == UNKNOWN or value == pytest.approx((2 * time - 100 * MS) / (5 * MS))


def test_first_value_of_a_state_may_be_old(scheduler: VirtualTime) -> None:
    """A transient-local topic delivers it when it is discovered."""
    found, refused = asked(scheduler, [Arrival(0, 1.0, 500 * MS)], period=0.1)

    assert refused == [Refused(0, 1.0, "it is 0.500 s late", 400 * MS + 1, is_first=True)]
    assert [each.value for each in found[:7]] == [None] * 5 + [1.0] * 2


def test_what_comes_right_after_an_old_first_value_says_so(scheduler: VirtualTime) -> None:
    """It is no news that a late reader gets an old value."""
    samples = [Arrival(0, 1.0, 500 * MS), Arrival(450 * MS, 3.0, 80 * MS), Arrival(600 * MS, 4.0, 0)]

    _, refused = asked(scheduler, samples, Unchanged())

    assert [(each.value, each.is_first) for each in refused] == [(1.0, True), (3.0, True)]


def test_late_value_does_not_replace_a_newer_one_that_waits(scheduler: VirtualTime) -> None:
    samples = [Arrival(0, 1.0, 200 * MS), Arrival(150 * MS, 2.0, 0)]

    found, refused = asked(scheduler, samples, period=0.1)

    assert found[2] == Answer(200 * MS, 2.0)
    assert [each.taken for each in refused] == [None]


def test_sample_far_ahead_of_the_clock_is_dropped(scheduler: VirtualTime) -> None:
    """It would wait, and fill the memory."""
    samples = [Arrival(0, 1.0, 0), Arrival(200 * MS, 2.0, -100 * MS), Arrival(500 * MS, 3.0, -101 * MS)]

    found, refused = asked(scheduler, samples, period=0.1)

    assert found[-1].value == 2.0
    assert refused == [Refused(500 * MS, 3.0, "it is 0.101 s ahead of the clock")]


def test_of_two_samples_with_one_time_the_first_counts(scheduler: VirtualTime) -> None:
    found, refused = asked(scheduler, [Arrival(0, 2.0, 0), Arrival(0, 1.0, MS)])

    assert {each.value for each in found} == {2.0}
    assert refused == [Refused(0, 1.0, "another sample has the same time")]


# Dead publishers


def test_value_of_a_dead_publisher_is_held(scheduler: VirtualTime) -> None:
    alive = hold(
        arriving(scheduler, [Arrival(0, True, 0), Arrival(300 * MS, False, 0), Arrival(500 * MS, True, 0)]),
        lateness=LATENESS,
    )
    signal = of_time(lambda time: time).certain_while(alive)

    found = answers(scheduler, signal, 0.1)

    assert all(each.value == each.time for each in found)
    assert [each.mark for each in found[:7]] == [CERTAIN] * 3 + [HELD] * 2 + [CERTAIN] * 2


def test_value_is_held_while_nothing_is_known_of_the_publisher(scheduler: VirtualTime) -> None:
    signal = constant(1.0).certain_while(hold(scheduler.hot(), lateness=LATENESS))

    assert {each.mark for each in answers(scheduler, signal)} == {HELD}


@pytest.mark.parametrize("silence", [Nothing(), Unchanged(), Held()])
def test_message_without_a_stamp_is_no_sample(scheduler: VirtualTime, silence: Silence) -> None:
    refused: list[Refused] = []
    messages = scheduler.hot(*((k / 10, by_header(PointStamped(header=header(k)))) for k in range(1, 20)))
    values = messages.map(lambda it: it._replace(value=it.value.header.frame_id))
    signal = interpolate(
        lambda a, b, ratio: a, values, lateness=0.1, gap=0.2, silence=silence, refused=refused.append
    )
    found = answers(scheduler, signal, 0.1, 2.0)

    assert {it.value for it in found if it.is_certain} <= {str(k) for k in range(10, 20)}
    assert refused == [Refused(UNSTAMPED, str(k), "it has no stamp") for k in range(1, 10)]


def header(tenth: int) -> Header:
    """Return a header of a driver that learns the time after a second."""
    sec, rest = divmod(tenth, 10) if tenth >= 10 else (0, 0)
    return Header(stamp=Time(sec=sec, nanosec=rest * 10**8), frame_id=str(tenth))
