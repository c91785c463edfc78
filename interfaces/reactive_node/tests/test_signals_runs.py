"""How a signal is evaluated: replay, memory, clocks, the end, and a node."""

from __future__ import annotations

import math
import random
from datetime import UTC, datetime
from typing import Any

import pytest
import reactivex as rx
from hypothesis import given
from hypothesis import strategies as st
from rclpy.node import Node
from reactivex import Observable, abc
from reactivex.disposable import Disposable
from reactivex.notification import OnError
from reactivex.subject import Subject
from reactivex.testing import ReactiveTest
from std_msgs.msg import Float64

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
from reactive_node import ReactiveNode
from reactive_node.scheduler import NodeScheduler
from reactive_node.signals import (
    CERTAIN,
    Answer,
    Extrapolated,
    Held,
    Nothing,
    Refused,
    Silence,
    Unchanged,
    as_taken,
    constant,
    hold,
    lift,
    linear,
)
from reactive_node.signals.integral import Integral
from reactive_node.signals.source import Source
from reactive_node.stamps import stamped
from reactive_node.testing import SpinUntil, VirtualTime

GAP = 0.1  # s


# Replay


@pytest.mark.parametrize("silence", [Nothing(), Unchanged(), Held(), Extrapolated(0.05)], ids=repr)
@given(samples=arrivals(most=400), randomness=st.randoms(use_true_random=False))
def test_replay_gives_the_answers_of_a_run_with_late_samples(
    samples: list[Arrival], silence: Silence, randomness: random.Random
) -> None:
    refused: list[Refused] = []

    def run(observable: Any, lateness: float, scheduler: VirtualTime) -> list[Answer[Any]]:
        signal = linear(observable, lateness=lateness, gap=GAP, silence=silence, refused=refused.append)
        return answers(scheduler, signal.derivative(GAP), until=2.5)

    live = VirtualTime()
    answered = run(arriving(live, samples), LATENESS, live)
    record, refused = refused, []
    again = VirtualTime()
    other = [each._replace(delay=randomness.randrange(400) * MS) for each in samples]
    replayed = run(as_taken(arriving(again, other), record), 0.5, again)

    count = min(len(answered), len(replayed))
    assert repr(replayed[:count]) == repr(answered[:count])
    assert count > 100
    assert not refused


def test_each_refusal_concerns_one_sample(scheduler: VirtualTime) -> None:
    first, copy, other = stamped("a", 5), stamped("a", 5), stamped("b", 5)
    refused = [Refused(5, "a", "late"), Refused(5, "b", "late", taken=7)]

    taken = as_taken(scheduler.hot((0.1, first), (0.2, copy), (0.3, other)), refused)

    assert items(scheduler, taken) == [stamped("a", 5), stamped("b", 7)]


# Memory and clocks


def test_integral_forgets_and_is_exact(scheduler: VirtualTime, monkeypatch: pytest.MonkeyPatch) -> None:
    """An integral forgets the values between two questions that are far apart."""
    kept: list[int] = []
    forget = Integral.forget

    def forgotten(self: Integral, time: int) -> None:
        forget(self, time)
        kept.append(len(self._sums))

    monkeypatch.setattr(Integral, "forget", forgotten)
    samples = rx.interval(0.02).map(lambda count: stamped(2.0, count * 20 * MS))
    signal = linear(samples, lateness=LATENESS, gap=GAP).integral(0.05)

    recording = scheduler.record(signal.sample(5.0), until=61.0)

    found = [answer.value for _, answer in recording.items]
    assert found == pytest.approx([10.0 * number for number in range(13)])
    assert 0 < max(kept[100:]) <= 5


def test_memory_is_flat(scheduler: VirtualTime, monkeypatch: pytest.MonkeyPatch) -> None:
    sources: list[Any] = []
    take = Source.settle

    def settle(self: Source, now: int) -> int:
        if self not in sources:
            sources.append(self)
        return take(self, now)

    monkeypatch.setattr(Source, "settle", settle)
    samples = rx.interval(0.02).map(lambda count: stamped(1.0, (count + 1) * 20 * MS))
    signal = linear(samples, lateness=LATENESS, gap=GAP)
    asked = lift(lambda *parts: parts)(
        signal.derivative(0.1), signal.integral(0.01), signal.window(0.5, 0.1), signal.delay(1.0)
    )

    recording = scheduler.record(asked.sample(0.05).map(lambda answer: answer.mark), until=100.0)

    (source,) = sources
    assert [mark for _, mark in recording.items].count(CERTAIN) > 1900
    assert len(source.waiting) < 10
    assert len(source) < 64 + 1.5 / 0.02


def test_clock_that_is_set_back_begins_again() -> None:
    """The value of a state does not come again."""
    clock = _Clock()
    moving, state = Subject[Any](), Subject[Any]()
    signal = lift(lambda *parts: parts)(
        hold(state, lateness=LATENESS),
        linear(state, lateness=LATENESS, gap=GAP, silence=Unchanged()),
        linear(moving, lateness=LATENESS, gap=GAP, silence=Held()).delay(0.0),
        constant(1.0).integral(0.1),
    )
    found: list[Any] = []
    signal.sample(0.1).subscribe(found.append, scheduler=clock)

    def send(time: float) -> None:
        moving.on_next(stamped(time, round(time * SECOND)))

    state.on_next(stamped("old state", -50 * MS))
    state.on_next(stamped("state", 0))
    for tenth in range(100):
        clock.time = tenth / 10
        send(tenth / 10)
    assert found[-1].time == 97 * 100 * MS
    found.clear()
    for tenth in range(50, 70):
        clock.time = tenth / 10
        send(tenth / 10)

    assert [each.time for each in found] == [tenth * 100 * MS for tenth in range(50, 68)]
    assert found[0].value == ("state", "state", 5.0, 0.0)
    assert found[-1].value == ("state", "state", 6.7, pytest.approx(1.7))


def test_samples_of_a_future_that_was_set_back_are_forgotten() -> None:
    clock = _Clock()
    samples = Subject[Any]()
    found: list[Answer[Any]] = []
    held = linear(samples, lateness=LATENESS, gap=GAP, silence=Held())
    held.sample(0.1).subscribe(found.append, scheduler=clock)
    for clock.time in (9.8, 9.9):
        samples.on_next(stamped("old", round(clock.time * SECOND)))
    found.clear()
    for clock.time, name in ((5.0, "new"), (9.0, "newer"), (11.0, "newest")):
        samples.on_next(stamped(name, round(clock.time * SECOND)))

    assert {each.value for each in found if each.time >= 9 * SECOND} == {"newer"}
    assert found[-1].time == 10_900 * MS


@pytest.mark.parametrize("delay", [0.05, 0.15])
def test_state_that_was_not_settled_survives_a_set_clock(delay: float) -> None:
    """It does not come again."""
    clock = _Clock()
    state = Subject[Any]()
    found: list[Any] = []
    refused: list[Refused] = []
    signal = lift(lambda *parts: parts)(
        hold(state, lateness=LATENESS),
        linear(state, lateness=LATENESS, gap=GAP, silence=Unchanged(), refused=refused.append),
    )
    signal.sample(0.1).subscribe(found.append, scheduler=clock)
    for clock.time, value, late in ((9.8, "old", 0.0), (10.0, "new", delay)):
        state.on_next(stamped(value, round((clock.time - late) * SECOND)))
    for clock.time in (5.0, 6.0):
        state.on_next(stamped("older", -1))
    assert found[-1] == Answer(5800 * MS, ("new", "new"))
    assert {each.taken for each in refused} == {None}

    for clock.time in (7.0, 8.0):
        state.on_next(stamped("late", 5500 * MS))
    assert found[-1] == Answer(7800 * MS, ("late", "late"))


def test_events_of_a_future_that_was_set_back_are_forgotten() -> None:
    clock = _Clock()
    samples, events = Subject[Any](), Subject[Any]()
    found: list[str] = []
    signal = linear(samples, lateness=LATENESS, gap=1.0)
    taken = signal.snapshot(events, lateness=LATENESS)
    taken.subscribe(lambda pair: found.append(pair[0]), scheduler=clock)
    clock.time = 9.75
    samples.on_next(stamped(0.0, 9750 * MS))
    for clock.time, name in ((9.8, "old"), (9.95, "older")):
        events.on_next(stamped(name, round(clock.time * SECOND)))
    for clock.time, name in ((5.0, "new"), (7.0, "newer"), (12.0, "newest"), (14.0, "last")):
        events.on_next(stamped(name, round(clock.time * SECOND)))

    assert found == ["new", "newer", "newest"]


def test_clock_that_goes_back_a_little_does_not_begin_again() -> None:
    clock = _Clock()
    found: list[Any] = []
    samples = Subject[Any]()
    hold(samples, lateness=LATENESS).sample(0.5).subscribe(found.append, scheduler=clock)
    for clock.time in (0.0, 2.0, 1.1, 2.5):
        samples.on_next(stamped(clock.time, round(clock.time * SECOND)))

    assert [each.time for each in found] == [500 * MS * k for k in range(5)]


class _Clock(VirtualTime):
    def __init__(self) -> None:
        super().__init__()
        self.time = 0.0

    @property
    def now(self) -> datetime:
        return datetime.fromtimestamp(self.time, UTC)


@pytest.mark.parametrize(
    ("is_simulated", "gained", "begins_again"),
    [
        (True, 0.0, False),  # the simulation is paused
        (True, 101.0, False),  # 20 times as fast as the steady clock
        (True, 101.1, True),
        (True, -1.0, False),
        (True, -1.1, True),
        (False, 6.0, False),
        (False, 6.1, True),
        (False, 4.0, False),
        (False, 3.9, True),
    ],
)
def test_clock_of_a_node_begins_again_if_it_was_set(
    monkeypatch: pytest.MonkeyPatch, is_simulated: bool, gained: float, begins_again: bool
) -> None:
    clock = _ClockOfNode(is_simulated)
    monkeypatch.setattr("time.monotonic_ns", lambda: clock.steady)
    found: list[Any] = []
    samples = Subject[Any]()
    hold(samples, lateness=LATENESS).sample(0.5).subscribe(found.append, scheduler=clock)
    for stamps, steady in ((0.5, 0.5), (gained, 5.0), (3.0, 3.0)):  # 201 s is asked for, and not yet known
        clock.pass_time(stamps, steady)
        samples.on_next(stamped(stamps, clock.stamps))

    assert (found[0].time != 201 * SECOND) == begins_again


class _ClockOfNode(NodeScheduler):
    """That of a node whose clocks stand still between two steps."""

    def __init__(self, is_simulated: bool) -> None:
        self.is_simulated = is_simulated
        self.stamps, self.steady = 200_550 * MS, 50 * SECOND

    def pass_time(self, stamps: float, steady: float) -> None:
        self.stamps += round(stamps * SECOND)
        self.steady += round(steady * SECOND)

    def time_of_stamps(self) -> int:
        return self.stamps

    def schedule_relative(self, *_: Any, **__: Any) -> abc.DisposableBase:
        return Disposable()


# Subscribing and ending


def test_each_subscription_has_its_own_memory(scheduler: VirtualTime) -> None:
    asked = hold(arriving(scheduler, [Arrival(0, 1.0, 0)]), lateness=LATENESS).sample(0.1)
    assert scheduler.record(asked, until=1.0).items

    assert {answer.value for _, answer in scheduler.record(asked, until=2.0).items} == {None}


def test_it_completes_when_all_samples_have_come(scheduler: VirtualTime) -> None:
    one = scheduler.create_hot_observable(
        ReactiveTest.on_next(0.1, stamped(1.0, 100 * MS)), ReactiveTest.on_completed(0.4)
    )
    other = scheduler.create_hot_observable(ReactiveTest.on_completed(0.63))
    signal = lift(lambda a, b: (a, b))(hold(one, lateness=LATENESS), hold(other, lateness=LATENESS))

    *messages, end = scheduler.record(signal.sample(0.1), until=2.0).messages

    assert end == ReactiveTest.on_completed(0.63)
    assert len(messages) == 7


def test_steady_answers_come_when_they_are_known_at_the_latest(scheduler: VirtualTime) -> None:
    """By then, none of their values is forgotten."""
    samples = arriving(scheduler, [Arrival(k * 80 * MS, float(k), 0) for k in range(1000)])
    signal = linear(samples, lateness=LATENESS, gap=GAP).delay(-0.01)

    found = scheduler.record(signal.sample(0.03, steady=True), until=79.0).items

    assert len(found) == 2627
    for at, (time, value, _) in found:
        assert at == pytest.approx(time / SECOND + LATENESS + GAP + 0.01, abs=1e-6)
        assert value == pytest.approx((time + 10 * MS) / (80 * MS))


def test_event_is_answered_at_the_very_time_when_it_is_known(scheduler: VirtualTime) -> None:
    events = arriving(scheduler, [Arrival(100 * MS, "a", 0)])
    signal = hold(scheduler.hot(), lateness=LATENESS)

    recording = scheduler.record(signal.snapshot(events, lateness=LATENESS), until=2.0)

    assert [at for at, _ in recording.items] == [pytest.approx(0.1 + LATENESS, abs=2e-7)]


def test_event_in_a_movement_does_not_wait_for_the_gap(scheduler: VirtualTime) -> None:
    events = arriving(scheduler, [Arrival(100 * MS, "a", 0)])
    signal = linear(
        arriving(scheduler, [Arrival(k * 40 * MS, 1.0, 0) for k in range(20)]), lateness=LATENESS, gap=GAP
    )

    recording = scheduler.record(signal.snapshot(events, lateness=LATENESS), until=2.0)

    assert [at for at, _ in recording.items] == [pytest.approx(0.24)]  # the first arrival after 0.12 + 0.1


def test_nothing_is_looked_at_again_before_its_time() -> None:
    """An event waits for other events: to look each microsecond would take the processor."""
    looks: list[float] = []

    class Counting(VirtualTime):
        def schedule_relative(self, duetime: Any, *others: Any, **options: Any) -> Any:
            looks.append(duetime)
            return super().schedule_relative(duetime, *others, **options)

    scheduler = Counting()
    events = arriving(scheduler, [Arrival(100 * MS, "a", 0)])
    before = len(looks)

    recording = scheduler.record(constant(1.0).snapshot(events, lateness=0.5), until=2.0)

    assert [pair for _, pair in recording.items] == [("a", Answer(100 * MS, 1.0))]
    assert len(looks) - before < 5


def test_snapshot_completes_when_all_events_are_answered(scheduler: VirtualTime) -> None:
    events = scheduler.create_hot_observable(
        ReactiveTest.on_next(0.1, stamped("a", 100 * MS)), ReactiveTest.on_completed(0.1)
    )
    signal = linear(scheduler.hot(), lateness=LATENESS, gap=GAP)

    messages = scheduler.record(signal.snapshot(events, lateness=LATENESS), until=2.0).messages

    assert [message.time for message in messages] == pytest.approx([0.3, 0.3])


@pytest.mark.parametrize("part", ["samples", "function", "predicate"])
def test_errors_are_errors_of_the_answers(scheduler: VirtualTime, part: str) -> None:
    def fail(_: Any) -> Any:
        raise ZeroDivisionError(part)

    samples = scheduler.create_hot_observable(
        ReactiveTest.on_error(0.3, ZeroDivisionError("samples"))
        if part == "samples"
        else ReactiveTest.on_next(0.3, stamped(1.0, 300 * MS))
    )
    signal = hold(samples, lateness=LATENESS)
    asked = {
        "samples": signal.sample(0.1),
        "function": lift(fail)(signal).sample(0.1),
        "predicate": signal.when(fail, resolution=0.1),
    }[part]

    *_, last = scheduler.record(asked, until=2.0).messages

    assert isinstance(last.value, OnError)
    assert str(last.value.exception) == part


def test_it_needs_a_clock() -> None:
    with pytest.raises(ValueError, match=r"^a signal needs a clock: .*scheduler=node.scheduler\)$"):
        constant(1.0).sample(0.1).subscribe()


def test_an_observer_may_send_samples(scheduler: VirtualTime) -> None:
    """Answers keep their order."""
    samples = Subject[Any]()
    found: list[int] = []

    def observe(answer: Answer[Any]) -> None:
        found.append(answer.time)
        samples.on_next(stamped(1.0, answer.time + SECOND))

    hold(samples, lateness=LATENESS).sample(0.1).subscribe(observe, scheduler=scheduler)
    scheduler.advance_to(2.0)

    assert found == [100 * MS * k for k in range(20)]


def test_samples_are_subscribed_from_the_question_to_its_disposal(scheduler: VirtualTime) -> None:
    samples = arriving(scheduler, [Arrival(k * 100 * MS, 1.0, 0) for k in range(20)])
    asked = hold(samples, lateness=LATENESS).sample(0.1)
    assert samples.subscriptions == []

    assert len(items(scheduler, asked.take(3))) == 3

    assert samples.subscriptions[0].subscribe == 0
    assert samples.subscriptions[0].unsubscribe < 0.5


# On a node


@pytest.mark.parametrize("hours", [1, -1])
def test_clock_that_is_set_begins_again(
    node: ReactiveNode, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch, hours: int
) -> None:
    """Nobody asked for the values of the hour that was left out. A state keeps its value."""
    samples, found = Subject[Any](), list[Answer[float]]()
    time_of_stamps = node.scheduler.time_of_stamps
    hold(samples, lateness=0.05).sample(0.01).subscribe(found.append, scheduler=node.scheduler)
    samples.on_next(stamped(1.0, time_of_stamps()))
    spin_until(lambda: found and found[-1].value == 1.0)
    found.clear()

    monkeypatch.setattr(node.scheduler, "time_of_stamps", lambda: time_of_stamps() + hours * 3600 * SECOND)
    first = node.scheduler.time_of_stamps()
    spin_until(lambda: [each for each in found if abs(each.time - first) < SECOND])

    after = [each for each in found if abs(each.time - first) < SECOND]
    assert found[-len(after) :] == after
    assert len(found) < 100
    spin_until(lambda: found[-1].value == 1.0)


def test_live_answers_are_those_of_virtual_time(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    """Not even their bytes differ."""
    publisher = peer.create_publisher(Float64, "value", 100)
    arrived: list[Any] = []
    refused: list[Refused] = []
    live: list[Answer[float]] = []

    def asked(samples: Observable[Any], lateness: float) -> Observable[Answer[float]]:
        signal = linear(samples, lateness=lateness, gap=1.0, silence=Held(), refused=refused.append)
        return signal.derivative(0.02).sample(0.01)

    messages = node.create_observable(Float64, "value", 100, timestamped=True)
    samples = messages.map(lambda it: it._replace(value=it.value.data)).do_action(arrived.append)
    asked(samples, 0.2).subscribe(live.append, scheduler=node.scheduler)
    spin_until(lambda: publisher.get_subscription_count())
    for number in range(50):
        publisher.publish(Float64(data=math.sin(number)))
        spin_until(lambda number=number: len(arrived) > number)
    spin_until(lambda: live and live[-1].time > arrived[-1].nanoseconds)

    scheduler = VirtualTime()
    scheduler.advance_to(arrived[0].nanoseconds / SECOND - 1.0)
    inputs = [(it.nanoseconds / SECOND + 0.001, it) for it in arrived]
    virtual = asked(as_taken(scheduler.hot(*inputs), refused), 0.3)
    found = items(scheduler, virtual, arrived[-1].nanoseconds / SECOND + 3.0)

    common = {answer.time for answer in found} & {answer.time for answer in live}
    assert len(common) > 5
    assert repr([it for it in found if it.time in common]) == repr([it for it in live if it.time in common])
