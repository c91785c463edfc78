from __future__ import annotations

import gc
import subprocess
import sys
import weakref
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import reactivex as rx
from action_msgs.srv import CancelGoal
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.action.client import ClientGoalHandle
from rclpy.node import Node
from rclpy.task import Future
from reactivex.abc import DisposableBase

from interfaces.reactive_node.tests.fibonacci import Fibonacci
from reactive_node import ReactiveNode
from reactive_node.actions import GoalAborted, GoalCanceled, GoalRejected, GoalUnknown
from reactive_node.testing import SpinFor, SpinUntil


class Server:
    def __init__(self, node: Node) -> None:
        self.goals: list[int] = []
        self.accept = True
        self.on_goal: Callable[[], None] = lambda: None
        self.feedback = [[0, 1], [0, 1, 1]]
        self.cancelled: list[int] = []
        self.ends: dict[int, Future] = {}
        self.handles: dict[int, Any] = {}
        self._server = ActionServer(
            node,
            Fibonacci,
            "fibonacci",
            self._execute,
            goal_callback=self._answer,
            cancel_callback=self._cancel,
        )

    def _answer(self, goal: Fibonacci.Goal) -> GoalResponse:
        self.goals.append(goal.order)
        self.on_goal()
        return GoalResponse.ACCEPT if self.accept else GoalResponse.REJECT

    def _cancel(self, handle: Any) -> CancelResponse:
        self.cancelled.append(handle.request.order)
        self.end(handle.request.order, "canceled")
        return CancelResponse.ACCEPT

    async def _execute(self, handle: Any) -> Fibonacci.Result:
        order = handle.request.order
        self.ends[order] = Future()
        self.handles[order] = handle
        for sequence in self.feedback:
            handle.publish_feedback(Fibonacci.Feedback(sequence=sequence))
        how = await self.ends[order]
        getattr(handle, how)()
        return Fibonacci.Result(sequence=[order])

    def end(self, order: int, how: str = "succeed") -> None:
        """End a goal: `succeed`, `abort` or `canceled`."""
        self.ends[order].set_result(how)

    def execute(self, order: int, watch: Watch, spin_until: SpinUntil) -> None:
        """Spin until the client knows that the goal is accepted.

        Feedback may overtake the acceptance, but not by so many callbacks.
        """
        spin_until(lambda: order in self.handles)
        expected = len(self.feedback)
        spin_until(lambda: len(watch.items) == expected)
        for number in range(expected + 1, expected + 20):
            self.handles[order].publish_feedback(feedback())
            spin_until(lambda number=number: len(watch.items) == number)
        del watch.items[expected:]

    def destroy(self) -> None:
        self._server.destroy()


class Watch:
    def __init__(self, execution: rx.Observable[Any], node: ReactiveNode) -> None:
        self.items: list[Any] = []
        self.errors: list[Exception] = []
        self.completed = False
        self.subscription: DisposableBase = execution.subscribe(
            self.items.append, self.errors.append, self._complete, scheduler=node.scheduler
        )

    def _complete(self) -> None:
        self.completed = True


@pytest.fixture
def server(peer: Node) -> Iterator[Server]:
    server = Server(peer)
    yield server
    server.destroy()


def feedback(*sequence: int) -> Fibonacci.Feedback:
    return Fibonacci.Feedback(sequence=sequence)


def result(*sequence: int) -> Fibonacci.Result:
    return Fibonacci.Result(sequence=sequence)


def goal(order: int) -> Fibonacci.Goal:
    return Fibonacci.Goal(order=order)


# The end of a goal


def test_execution_emits_feedback_then_result_then_completes(
    node: ReactiveNode, server: Server, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    watch = Watch(node.create_action_call(Fibonacci, "fibonacci")(goal(7)), node)

    spin_until(lambda: watch.items == [feedback(0, 1), feedback(0, 1, 1)])
    server.end(7)
    spin_until(lambda: watch.completed)
    spin_for(0.05)

    assert watch.items == [feedback(0, 1), feedback(0, 1, 1), result(7)]
    assert (watch.errors, server.goals, server.cancelled) == ([], [7], [])


def test_execution_waits_for_server_without_blocking(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    watch = Watch(node.create_action_call(Fibonacci, "fibonacci")(goal(7)), node)
    ticks: list[int] = []
    rx.interval(0.01).subscribe(ticks.append, scheduler=node.scheduler)
    spin_until(lambda: len(ticks) > 10)

    server = Server(peer)
    spin_until(lambda: watch.items)
    server.end(7)
    spin_until(lambda: watch.completed)
    server.destroy()


def test_rejected_goal_is_error(node: ReactiveNode, server: Server, spin_until: SpinUntil) -> None:
    server.accept = False

    watch = Watch(node.create_action_call(Fibonacci, "fibonacci")(goal(7)), node)
    spin_until(lambda: watch.errors)

    assert isinstance(watch.errors[0], GoalRejected)
    assert str(watch.errors[0]) == "the server of fibonacci rejected the goal"
    assert (watch.items, watch.completed) == ([], False)


def test_aborted_goal_is_error_with_result(node: ReactiveNode, server: Server, spin_until: SpinUntil) -> None:
    watch = Watch(node.create_action_call(Fibonacci, "fibonacci")(goal(7)), node)
    spin_until(lambda: len(watch.items) == 2)

    server.end(7, "abort")
    spin_until(lambda: watch.errors)

    assert isinstance(watch.errors[0], GoalAborted)
    assert str(watch.errors[0]) == "the server of fibonacci aborted the goal"
    assert watch.errors[0].result == result(7)


def test_goal_that_another_client_cancels_is_error_with_result(
    node: ReactiveNode, server: Server, spin_until: SpinUntil
) -> None:
    watch = Watch(node.create_action_call(Fibonacci, "fibonacci")(goal(7)), node)
    spin_until(lambda: len(watch.items) == 2)

    cancel_all = node.create_call(CancelGoal, "fibonacci/_action/cancel_goal")
    cancel_all(CancelGoal.Request()).subscribe()
    spin_until(lambda: watch.errors)

    assert isinstance(watch.errors[0], GoalCanceled)
    assert watch.errors[0].result == result(7)
    assert server.cancelled == [7]


def test_goal_that_server_has_forgotten_is_error(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    def execute(handle: Any) -> Fibonacci.Result:
        handle.succeed()
        return result()

    server = ActionServer(peer, Fibonacci, "fibonacci", execute, result_timeout=0)
    watch = Watch(node.create_action_call(Fibonacci, "fibonacci")(goal(7)), node)
    spin_until(lambda: watch.errors)

    assert isinstance(watch.errors[0], GoalUnknown)
    assert str(watch.errors[0]) == "the server of fibonacci does not know the goal any more"
    server.destroy()


# Cancelling


def test_disposing_cancels_goal(
    node: ReactiveNode, server: Server, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    watch = Watch(node.create_action_call(Fibonacci, "fibonacci")(goal(7)), node)
    server.execute(7, watch, spin_until)

    watch.subscription.dispose()
    spin_until(lambda: server.cancelled == [7])
    spin_for(0.05)

    assert len(watch.items) == 2
    assert (watch.errors, watch.completed) == ([], False)


def test_goal_disposed_before_its_acceptance_is_cancelled_and_forgotten(
    node: ReactiveNode, server: Server, spin_until: SpinUntil
) -> None:
    server.feedback = []
    watches: list[Watch] = []
    server.on_goal = lambda: watches[0].subscription.dispose()

    watches.append(Watch(node.create_action_call(Fibonacci, "fibonacci")(goal(7)), node))
    spin_until(lambda: server.cancelled == [7])
    assert watches[0].items == []

    kept = weakref.ref(watches.pop())

    spin_until(lambda: gc.collect() >= 0 and kept() is None)


def test_goal_disposed_while_it_waits_for_server_is_not_sent(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    act = node.create_action_call(Fibonacci, "fibonacci")
    abandoned = Watch(act(goal(7)), node)
    spin_for(0.1)
    abandoned.subscription.dispose()

    server = Server(peer)
    Watch(act(goal(8)), node)
    spin_until(lambda: server.goals)
    spin_for(0.1)

    assert server.goals == [8]
    server.destroy()


def test_goal_that_has_ended_is_not_cancelled(
    node: ReactiveNode, server: Server, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    cancelled: list[ClientGoalHandle] = []
    monkeypatch.setattr(ClientGoalHandle, "cancel_goal_async", cancelled.append)
    watch = Watch(node.create_action_call(Fibonacci, "fibonacci")(goal(7)), node)
    server.execute(7, watch, spin_until)

    server.end(7)
    spin_until(lambda: watch.completed)
    watch.subscription.dispose()

    assert cancelled == []


@pytest.mark.filterwarnings("ignore:failed to send response")  # with Fast DDS, the server says who has gone
def test_end_of_node_completes_execution_and_cancels_goal(
    node: ReactiveNode, server: Server, spin_until: SpinUntil
) -> None:
    watch = Watch(node.create_action_call(Fibonacci, "fibonacci")(goal(7)), node)
    server.execute(7, watch, spin_until)

    node.destroy_node()
    assert watch.completed
    spin_until(lambda: server.cancelled == [7])
    assert not [waitable for waitable in node.waitables if isinstance(waitable, ActionClient)]


# Several goals


def test_each_subscription_sends_a_goal(node: ReactiveNode, server: Server, spin_until: SpinUntil) -> None:
    execution = node.create_action_call(Fibonacci, "fibonacci")(goal(7))

    first, second = Watch(execution, node), Watch(execution, node)
    spin_until(lambda: len(first.items) == len(second.items) == 2)

    assert server.goals == [7, 7]


def test_node_without_actions_does_not_import_them() -> None:
    program = "import reactive_node, sys; print([name for name in sys.modules if 'rclpy.action' in name])"

    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)

    assert run.stdout == "[]\n"
