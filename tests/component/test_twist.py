from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from reactivex import Observable
from reactivex.subject import Subject
from std_msgs.msg import Float64

from interfaces.service.states import state
from interfaces.topics import CONFIGURATION, EFFECTOR_TWIST
from reactive_node.signals import CERTAIN, HELD, UNKNOWN, Answer
from reactive_node.stamps import from_message, now, stamped
from reactive_node.testing import SpinUntil, VirtualTime
from services import twist
from services.twist import PERIOD, effector_twist
from tests.component.wiring import Connect

NS = 10**9
RATE = 25.0  # Hz
GAP = 0.1  # s


def sampled(
    scheduler: VirtualTime, value: Callable[[float], float], times: list[float], delay: float = 0.002
) -> Any:
    return scheduler.hot(*((t + delay, stamped(value(t), round(t * NS))) for t in times))


def velocities(
    scheduler: VirtualTime, *topics: Any, alive: Observable[Any] | None = None, until: float = 3.0
) -> list[Answer[Any]]:
    living = scheduler.hot((0.01, stamped(True, 0))) if alive is None else alive
    observable = effector_twist([state(each, living, GAP) for each in topics], GAP)
    return [answer for _, answer in scheduler.record(observable, until=until).items if answer.is_certain]


def theta1(t: float) -> float:
    return 0.8 * math.sin(2.0 * t)


def test_velocity_is_the_derivative_of_the_position(scheduler: VirtualTime) -> None:
    moving = [k / RATE for k in range(1, 75)]
    found = velocities(
        scheduler,
        sampled(scheduler, lambda _: 2.0, [0.05]),
        sampled(scheduler, lambda _: 3.0, [0.05]),
        sampled(scheduler, theta1, moving),
        sampled(scheduler, lambda _: 0.0, [0.05]),
    )

    assert len(found) > 120
    for time, (x, y, turn), _ in found:
        angle, rate = theta1(time / NS), 1.6 * math.cos(2.0 * time / NS)
        assert x == pytest.approx(-5.0 * math.sin(angle) * rate, abs=0.05)
        assert y == pytest.approx(5.0 * math.cos(angle) * rate, abs=0.05)
        assert turn == pytest.approx(rate, abs=0.01)


def test_resting_arm_has_velocity_zero(scheduler: VirtualTime) -> None:
    found = velocities(scheduler, *(sampled(scheduler, lambda _: 1.0, [0.1]) for _ in range(4)))

    assert found[0].time == 260_000_000  # the first multiple of 20 ms a gap and a half after all are known
    assert {answer.value for answer in found} == {(0.0, 0.0, 0.0)}
    assert {b.time - a.time for a, b in pairwise(found)} == {PERIOD * NS}


def test_step_of_a_joint_is_no_velocity(scheduler: VirtualTime) -> None:
    """Nobody knows how fast it moved in the gaps around the step."""
    rest = [sampled(scheduler, lambda _: 1.0, [0.1]) for _ in range(3)]

    found = velocities(scheduler, *rest, sampled(scheduler, lambda t: float(t > 1.0), [0.1, 1.5]))

    assert {answer.value for answer in found} == {(0.0, 0.0, 0.0)}
    silent = [(a.time / NS, b.time / NS) for a, b in pairwise(found) if b.time - a.time > PERIOD * NS]
    assert silent == [tuple(pytest.approx(1.5 + side * 1.5 * GAP, abs=PERIOD) for side in (-1, 1))]


@pytest.mark.parametrize("stall", [0.12, 0.143, 0.19])
def test_source_that_pauses_in_a_movement_is_no_rest(scheduler: VirtualTime, stall: float) -> None:
    """A busy machine delays its timer. Taken for a rest, 143 ms were an error of 43 %."""
    times = [k / RATE for k in range(1, 26)] + [1.0 + stall + k / RATE for k in range(25)]
    rest = [sampled(scheduler, lambda _: 1.0, [0.05]) for _ in range(3)]

    found = velocities(scheduler, *rest, sampled(scheduler, lambda t: t, times), until=2.0)

    assert {round(answer.value[2], 6) for answer in found if 0.2 < answer.time / NS < 1.9} == {1.0}


def test_late_and_disordered_messages_change_nothing(scheduler: VirtualTime) -> None:
    times = [k / RATE for k in range(1, 75)]
    results = []
    for delays in ([0.001] * 74, [0.049 if k % 3 else 0.001 for k in range(74)]):
        scheduler = VirtualTime()
        moving = scheduler.hot(
            *sorted((t + d, stamped(theta1(t), round(t * NS))) for t, d in zip(times, delays, strict=True))
        )
        rest = [sampled(scheduler, lambda _: 1.0, [0.05]) for _ in range(3)]
        results.append(velocities(scheduler, *rest, moving))

    assert results[0] == results[1]


def test_nothing_is_known_while_a_publisher_is_dead(scheduler: VirtualTime) -> None:
    alive = scheduler.hot(
        (0.0, stamped(True, 0)), (1.0, stamped(False, 1 * NS)), (2.0, stamped(True, 2 * NS))
    )
    rest = [sampled(scheduler, lambda _: 1.0, [0.05]) for _ in range(4)]

    times = [answer.time / NS for answer in velocities(scheduler, *rest, alive=alive)]

    assert not [time for time in times if 1.0 - GAP / 2 <= time < 2.0 - GAP / 2]
    assert {time for time in times if time > 2.1}


@pytest.mark.parametrize(("namespace", "frame"), [("", "base"), ("/arm1", "arm1/base")])
def test_velocity_has_its_frame_and_its_time(
    connect: Connect, spin_until: SpinUntil, namespace: str, frame: str
) -> None:
    wired = connect(twist.wire, inputs=CONFIGURATION.values(), outputs=[EFFECTOR_TWIST], namespace=namespace)
    before = now()
    for topic in CONFIGURATION.values():
        wired.publish(topic, Float64(data=1.0))
    heard: list[Any] = wired.heard[EFFECTOR_TWIST.name]
    spin_until(lambda: heard)

    assert heard[0].header.frame_id == frame
    assert before <= from_message(heard[0].header.stamp) <= now()
    linear, angular = heard[0].twist.linear, heard[0].twist.angular
    assert (linear.x, linear.y, angular.z) == (0.0, 0.0, 0.0)
    assert wired.remarks() == []


def test_only_a_certain_velocity_is_sent_and_others_are_counted(
    connect: Connect, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers: Subject[Answer[Any]] = Subject()
    monkeypatch.setattr(twist, "effector_twist", lambda *_: answers)
    wired = connect(twist.wire, outputs=[EFFECTOR_TWIST])
    spin_until(lambda: answers.observers)
    for time, mark in enumerate((CERTAIN, HELD, UNKNOWN, CERTAIN, HELD)):
        answers.on_next(Answer(time, (0.1, 0.2, 0.3), mark))
    spin_until(lambda: len(wired.heard[EFFECTOR_TWIST.name]) == 2)
    wired.remarks()

    heard = wired.heard[EFFECTOR_TWIST.name]
    assert [it.header.stamp.nanosec for it in heard] == [0, 3]
    assert {(it.twist.linear.x, it.twist.linear.y, it.twist.angular.z) for it in heard} == {(0.1, 0.2, 0.3)}
    assert wired.reports()[-1]["uncertain"] == "3"

    (viewer,) = [it for it in wired.peer.subscriptions if it.topic_name == f"/{EFFECTOR_TWIST.name}"]
    wired.peer.destroy_subscription(viewer)
    spin_until(lambda: not answers.observers)  # nobody looks
