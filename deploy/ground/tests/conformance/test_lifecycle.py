"""Lifecycle nodes: transitions, their callbacks, managed entities, services and events."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from deploy.ground.tests.nodes import Call, SpinUntil
from lifecycle_msgs.msg import State, Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import (
    LifecycleNode,
    LifecycleState,
    TransitionCallbackReturn,
)
from rclpy.node import Node

SUCCESS, FAILURE, ERROR = (
    TransitionCallbackReturn.SUCCESS,
    TransitionCallbackReturn.FAILURE,
    TransitionCallbackReturn.ERROR,
)
RCLError = rclpy_implementation.RCLError


class Machine(LifecycleNode):
    def __init__(self, context: Context, **options: Any) -> None:
        self.calls: list[tuple[str, str]] = []
        self.results: dict[str, Any] = {}
        super().__init__("machine", context=context, **options)

    def called(self, name: str, state: LifecycleState) -> TransitionCallbackReturn:
        self.calls.append((name, state.label))
        result = self.results.get(name, SUCCESS)
        if isinstance(result, Exception):
            raise result
        return result  # type: ignore[no-any-return]

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self.called("configure", state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self.called("cleanup", state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self.called("shutdown", state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self.called("activate", state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self.called("deactivate", state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self.called("error", state)


@pytest.fixture
def machine(context: Context, executor: SingleThreadedExecutor) -> Any:
    machine = Machine(context)
    executor.add_node(machine)
    yield machine
    machine.destroy_node()


@pytest.fixture
def state(machine: Machine, call: Call) -> Callable[[], str]:
    return lambda: str(call(GetState, "machine/get_state").current_state.label)


State_ = Callable[[], str]


def test_a_node_goes_through_its_life(machine: Machine, state: State_) -> None:
    assert state() == "unconfigured"
    steps = [
        (machine.trigger_configure, "inactive"),
        (machine.trigger_activate, "active"),
        (machine.trigger_deactivate, "inactive"),
        (machine.trigger_cleanup, "unconfigured"),
        (machine.trigger_shutdown, "finalized"),
    ]
    for trigger, after in steps:
        assert trigger() == SUCCESS
        assert state() == after
    assert machine.calls == [
        ("configure", "unconfigured"),
        ("activate", "inactive"),
        ("deactivate", "active"),
        ("cleanup", "inactive"),
        ("shutdown", "unconfigured"),
    ]


@pytest.mark.parametrize("before", [[], ["configure"], ["configure", "activate"]])
def test_a_node_is_shut_down_from_any_primary_state(
    machine: Machine, state: State_, before: list[str]
) -> None:
    for step in before:
        getattr(machine, f"trigger_{step}")()
    assert machine.trigger_shutdown() == SUCCESS
    assert state() == "finalized"
    with pytest.raises(RCLError):
        machine.trigger_shutdown()


def test_a_transition_that_the_state_does_not_allow_is_an_error(machine: Machine, state: State_) -> None:
    for trigger in (machine.trigger_activate, machine.trigger_deactivate, machine.trigger_cleanup):
        with pytest.raises(RCLError, match="Failed to trigger lifecycle state machine transition"):
            trigger()
    assert state() == "unconfigured"
    assert machine.calls == []


@pytest.mark.parametrize(
    ("steps", "failing", "after"),
    [
        ([], "configure", "unconfigured"),
        (["configure"], "cleanup", "inactive"),
        (["configure"], "activate", "inactive"),
        (["configure", "activate"], "deactivate", "active"),
        ([], "shutdown", "finalized"),
    ],
)
def test_a_transition_that_fails_leads_back(
    machine: Machine, state: State_, steps: list[str], failing: str, after: str
) -> None:
    machine.results[failing] = FAILURE
    for step in steps:
        assert getattr(machine, f"trigger_{step}")() == SUCCESS
    assert getattr(machine, f"trigger_{failing}")() == FAILURE
    assert state() == after


@pytest.mark.parametrize(
    ("handled", "after"), [(SUCCESS, "unconfigured"), (FAILURE, "finalized"), (ERROR, "finalized")]
)
@pytest.mark.parametrize("error", [ERROR, ZeroDivisionError("planted")])
def test_an_error_is_handled_or_final(
    machine: Machine, state: State_, error: Any, handled: TransitionCallbackReturn, after: str
) -> None:
    machine.results.update(activate=error, error=handled)
    machine.trigger_configure()
    assert machine.trigger_activate() == ERROR
    assert state() == after
    assert machine.calls[-2:] == [("activate", "inactive"), ("error", "inactive")]


def test_other_nodes_ask_for_transitions_by_number_or_label(call: Call, state: State_) -> None:
    by_number = Transition(id=Transition.TRANSITION_CONFIGURE)
    assert call(ChangeState, "machine/change_state", transition=by_number).success
    assert state() == "inactive"
    assert call(ChangeState, "machine/change_state", transition=Transition(label="activate")).success
    assert state() == "active"
    assert not call(ChangeState, "machine/change_state", transition=Transition(label="configure")).success
    assert state() == "active"


def test_other_nodes_learn_states_and_transitions(machine: Machine, call: Call) -> None:
    states = call(GetAvailableStates, "machine/get_available_states").available_states
    assert {(state.id, state.label) for state in states} == {
        (State.PRIMARY_STATE_UNKNOWN, "unknown"),
        (State.PRIMARY_STATE_UNCONFIGURED, "unconfigured"),
        (State.PRIMARY_STATE_INACTIVE, "inactive"),
        (State.PRIMARY_STATE_ACTIVE, "active"),
        (State.PRIMARY_STATE_FINALIZED, "finalized"),
        (State.TRANSITION_STATE_CONFIGURING, "configuring"),
        (State.TRANSITION_STATE_CLEANINGUP, "cleaningup"),
        (State.TRANSITION_STATE_SHUTTINGDOWN, "shuttingdown"),
        (State.TRANSITION_STATE_ACTIVATING, "activating"),
        (State.TRANSITION_STATE_DEACTIVATING, "deactivating"),
        (State.TRANSITION_STATE_ERRORPROCESSING, "errorprocessing"),
    }
    machine.trigger_configure()
    found = call(GetAvailableTransitions, "machine/get_available_transitions").available_transitions
    assert {(one.transition.id, one.transition.label, one.goal_state.label) for one in found} == {
        (Transition.TRANSITION_CLEANUP, "cleanup", "cleaningup"),
        (Transition.TRANSITION_ACTIVATE, "activate", "activating"),
        (Transition.TRANSITION_INACTIVE_SHUTDOWN, "shutdown", "shuttingdown"),
    }
    graph = call(GetAvailableTransitions, "machine/get_transition_graph").available_transitions
    assert len(graph) == 25
    by_id = {one.transition.id: one for one in graph}
    on_error = by_id[Transition.TRANSITION_ON_ERROR_SUCCESS]
    assert on_error.transition.label == "transition_success"
    assert (on_error.start_state.label, on_error.goal_state.label) == ("errorprocessing", "unconfigured")


def test_transitions_are_published(machine: Machine, node: Node, spin_until: SpinUntil) -> None:
    events: list[tuple[str, str]] = []
    node.create_subscription(
        TransitionEvent,
        "machine/transition_event",
        lambda event: events.append((event.start_state.label, event.goal_state.label)),
        10,
    )
    spin_until(lambda: machine.count_subscribers("machine/transition_event"))
    spin_until(lambda: node.count_publishers("machine/transition_event"))
    machine.trigger_configure()
    spin_until(lambda: len(events) == 2)
    assert events == [("unconfigured", "configuring"), ("configuring", "inactive")]


def test_a_node_without_services_has_a_lifecycle(context: Context) -> None:
    node = LifecycleNode("closed", context=context, enable_communication_interface=False)
    assert [one for one in node.services if "change_state" in one.srv_name] == []
    assert node.trigger_configure() == SUCCESS
    node.destroy_node()
    half = LifecycleNode.__new__(LifecycleNode)
    with pytest.raises(TypeError):
        half.__init__("half", context=context, enable_communication_interface="yes")  # type: ignore[misc]
    half.destroy_node()
