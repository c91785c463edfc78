"""Lifecycle nodes: wrong requests and callbacks, facts on the wire, what other programs must not pay."""

from __future__ import annotations

from typing import Any

import pytest
from deploy.runtime.tests.nodes import Call

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn


def test_an_impossible_transition_is_refused(
    context: Context, executor: SingleThreadedExecutor, call: Call
) -> None:
    machine = LifecycleNode("machine", context=context)
    executor.add_node(machine)
    for number in (Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_ON_CONFIGURE_SUCCESS, 200):
        assert not call(ChangeState, "machine/change_state", transition=Transition(id=number)).success
    machine.destroy_node()


@pytest.mark.parametrize("result", [None, True, "ok"])
def test_a_callback_that_returns_something_else_is_an_error(
    context: Context, capfd: pytest.CaptureFixture[str], result: Any
) -> None:
    class Wrong(LifecycleNode):
        def on_configure(self, state: Any) -> Any:
            return result

    node = Wrong("wrong", context=context)
    assert node.trigger_configure() is TransitionCallbackReturn.ERROR
    assert f"configuring must return a TransitionCallbackReturn, not {result!r}" in capfd.readouterr().err
    node.destroy_node()


def test_an_error_in_a_callback_is_logged(context: Context, capfd: pytest.CaptureFixture[str]) -> None:
    class Wrong(LifecycleNode):
        def on_configure(self, state: Any) -> Any:
            raise ZeroDivisionError("planted")

    node = Wrong("wrong", context=context)
    node.trigger_configure()
    assert "ZeroDivisionError: planted" in capfd.readouterr().err
    node.destroy_node()
