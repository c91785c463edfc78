"""Callback groups: which entities may run at the same time."""

from __future__ import annotations

import pytest

from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup


class Entity:
    """Stands for a subscription or a timer."""


def test_a_group_does_not_keep_its_entities_alive() -> None:
    group = ReentrantCallbackGroup()
    entity, other = Entity(), Entity()
    group.add_entity(entity)
    assert group.has_entity(entity)
    assert not group.has_entity(other)
    del entity
    assert not any(reference() for reference in group.entities)


def test_a_mutually_exclusive_group_runs_one_entity_at_a_time() -> None:
    group = MutuallyExclusiveCallbackGroup()
    first, second = Entity(), Entity()
    group.add_entity(first)
    group.add_entity(second)
    assert group.can_execute(first)
    assert group.beginning_execution(first)
    assert not group.can_execute(first)
    assert not group.can_execute(second)
    assert not group.beginning_execution(second)
    group.ending_execution(first)
    assert group.beginning_execution(second)


def test_ending_a_callback_that_never_began_is_an_error() -> None:
    group = MutuallyExclusiveCallbackGroup()
    with pytest.raises(AssertionError):
        group.ending_execution(Entity())


def test_a_reentrant_group_lets_every_entity_run() -> None:
    group = ReentrantCallbackGroup()
    entity = Entity()
    for _ in range(3):
        assert group.can_execute(entity)
        assert group.beginning_execution(entity)
    group.ending_execution(entity)


def test_the_base_class_implements_no_decision() -> None:
    group, entity = CallbackGroup(), Entity()
    for decide in (group.can_execute, group.beginning_execution, group.ending_execution):
        with pytest.raises(NotImplementedError):
            decide(entity)
