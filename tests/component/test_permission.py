from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.node import Node
from std_msgs.msg import String

from interfaces import permission
from interfaces.permission import EngineState, permissions
from interfaces.service import ServiceNode
from interfaces.topics import ENGINES_STATE, OFF, ON
from reactive_node.testing import MakeNode, SpinUntil, VirtualTime


def changes(*states: tuple[float, str, float], until: float = 3.0) -> list[tuple[float, bool]]:
    """Return the changes of the permission, each with its time, for states with their times and ages."""
    scheduler = VirtualTime()
    heard = scheduler.hot(*((at, (name, age)) for at, name, age in states))
    stamped = heard.map(lambda it: EngineState(it[0], scheduler.now, it[1]))
    return scheduler.record(permissions(stamped).distinct_until_changed(), until=until).items


def permitted(*states: tuple[float, str, float]) -> list[tuple[float, bool]]:
    return [(round(at, 2), is_on) for at, is_on in changes(*states)]


def test_nothing_is_permitted_before_the_first_state() -> None:
    assert permitted() == [(0.0, False)]


def test_off_ends_the_permission_at_once() -> None:
    assert permitted((1.0, ON, 0.0), (1.2, OFF, 9.0)) == [(0.0, False), (1.0, True), (1.2, False)]


def test_on_has_to_wait_until_an_off_does_not_count_any_more() -> None:
    states = [(1.0, OFF, 9.0), *((1.05 + 0.1 * n, ON, 0.0) for n in range(6))]
    assert permitted(*states) == [(0.0, False), (1.45, True), (1.95, False)]


def test_single_on_that_comes_too_soon_after_an_off_permits_nothing() -> None:
    assert permitted((1.0, OFF, 9.0), (1.399, ON, 0.0)) == [(0.0, False)]
    assert permitted((1.0, OFF, 9.0), (1.4, ON, 0.0)) == [(0.0, False), (1.4, True), (1.8, False)]


def test_of_two_controllers_none_permits_against_the_other() -> None:
    one = [(1.0 + 0.1 * n, ON, 0.0) for n in range(20)]
    other = [(1.55 + 0.1 * n, OFF, 0.0) for n in range(5)]
    found = permitted(*sorted([*one, *other]))
    assert found == [(0.0, False), (1.0, True), (1.55, False), (2.4, True)]


@pytest.mark.parametrize(("age", "end"), [(0.0, 1.4), (0.1, 1.3), (-5.0, 1.4)])
def test_on_permits_for_400_ms_from_its_source_time(age: float, end: float) -> None:
    assert permitted((1.0, ON, age)) == [(0.0, False), (1.0, True), (end, False)]


@pytest.mark.parametrize("age", [0.4, 9.0])
def test_on_that_waited_permits_nothing_and_ends_an_older_one(age: float) -> None:
    assert permitted((1.0, ON, age)) == [(0.0, False)]
    assert permitted((1.0, ON, 0.0), (1.1, ON, age)) == [(0.0, False), (1.0, True), (1.1, False)]


def test_repeated_on_permits_without_a_gap() -> None:
    states = [(1.0 + 0.1 * n, ON, 0.0) for n in range(11)]
    assert permitted(*states) == [(0.0, False), (1.0, True), (2.4, False)]


states = st.lists(
    st.tuples(st.floats(0.5, 6.0), st.sampled_from([ON, OFF]), st.floats(-1.0, 1.0)),
    unique_by=lambda state: state[0],
)


@given(states)
def test_no_permission_outlives_the_on_that_gave_it(states: list[tuple[float, str, float]]) -> None:
    ordered = sorted(states)
    found = changes(*ordered, until=8.0)

    assert not found[-1][1]
    for (begin, is_on), (end, _) in itertools.pairwise(found):
        if is_on:
            before = [state for state in ordered if state[0] <= end]
            until = [at + 0.4 - max(age, 0.0) for at, name, age in before if name == ON and age < 0.4]
            assert begin <= end <= max(until) + 0.02
            offs = [at for at, name, _ in ordered if name == OFF]
            assert not [at for at in offs if begin - 0.38 < at < end - 0.02]


def test_a_paused_drive_finds_the_off_of_each_controller(make_node: MakeNode, spin_until: SpinUntil) -> None:
    one, other = (
        make_node(name, kind=Node).create_publisher(String, ENGINES_STATE.name, ENGINES_STATE.qos)
        for name in ("one", "other")
    )
    heard: list[bool] = []
    permission.observe(make_node("drive", kind=ServiceNode)).subscribe(heard.append)
    spin_until(lambda: one.get_subscription_count() == other.get_subscription_count() == 1)
    one.publish(String(data=OFF))
    for _ in range(9):
        other.publish(String(data=ON))
    spin_until(lambda: len(heard) > 1)  # begins to spin now: all waited
    assert not any(heard)
