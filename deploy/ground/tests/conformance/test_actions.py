"""Actions: goals, feedback, results, cancellation, several goals, results that expire."""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest
from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from deploy.ground.tests.conformance.fibonacci import Fibonacci
from deploy.ground.tests.nodes import MakeNode, SpinUntil, spinning
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import qos_profile_action_status_default
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

MakeServer = Callable[..., ActionServer]
Response = Any

SUCCEEDED, CANCELED, ABORTED = (
    GoalStatus.STATUS_SUCCEEDED,
    GoalStatus.STATUS_CANCELED,
    GoalStatus.STATUS_ABORTED,
)


def fibonacci(goal_handle: ServerGoalHandle) -> Fibonacci.Result:
    sequence = [0, 1]
    for _ in range(goal_handle.request.order):
        sequence.append(sequence[-2] + sequence[-1])
        goal_handle.publish_feedback(Fibonacci.Feedback(sequence=sequence))
    goal_handle.succeed()
    return Fibonacci.Result(sequence=sequence)


def accept_cancel(goal_handle: ServerGoalHandle) -> CancelResponse:
    return CancelResponse.ACCEPT


def keep(goal_handle: ServerGoalHandle) -> None:
    """Accept a goal without executing it."""


class Task:
    def __init__(self) -> None:
        self.goals: list[ServerGoalHandle] = []
        self.ends: list[Future] = []

    async def __call__(self, goal_handle: ServerGoalHandle) -> Fibonacci.Result:
        self.goals.append(goal_handle)
        self.ends.append(Future())
        await self.ends[-1]
        return Fibonacci.Result(sequence=[goal_handle.request.order])

    def end(self, index: int, how: Callable[[ServerGoalHandle], None]) -> None:
        how(self.goals[index])
        self.ends[index].set_result(None)


@pytest.fixture
def task() -> Task:
    return Task()


@pytest.fixture
def serve(node: Node) -> Iterator[MakeServer]:
    servers = []

    def make(execute: Callable[[ServerGoalHandle], Any] = fibonacci, **options: Any) -> ActionServer:
        async def asynchronous(goal_handle: ServerGoalHandle) -> Fibonacci.Result:
            return await execute(goal_handle)

        callback = asynchronous if isinstance(execute, Task) else execute
        servers.append(ActionServer(node, Fibonacci, "fibonacci", callback, **options))
        return servers[-1]

    yield make
    for server in servers:
        with suppress(ValueError):  # rclpy, of a server that the test has destroyed
            server.destroy()


@pytest.fixture
def client(
    make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> Iterator[ActionClient]:
    """A client of the action ``fibonacci`` on another node of the executor."""
    node = make_node("asker")
    executor.add_node(node)
    client = ActionClient(node, Fibonacci, "fibonacci")
    yield client
    client.destroy()


class Goal:
    def __init__(self, client: ActionClient, spin_until: SpinUntil, order: int, **options: Any) -> None:
        assert client.wait_for_server(timeout_sec=10)
        self.spin_until = spin_until
        self.feedback: list[list[int]] = []
        self.future = client.send_goal_async(Fibonacci.Goal(order=order), self.hear, **options)

    def hear(self, message: Any) -> None:
        self.feedback.append(list(message.feedback.sequence))

    def wait(self, future: Future) -> Any:
        self.spin_until(future.done)
        return future.result()

    def handle(self) -> Any:
        return self.wait(self.future)

    def result(self) -> Any:
        return self.wait(self.handle().get_result_async())

    def cancel(self) -> Any:
        return self.wait(self.handle().cancel_goal_async())


@pytest.fixture
def send(client: ActionClient, spin_until: SpinUntil) -> Callable[..., Goal]:
    return lambda order=3, **options: Goal(client, spin_until, order, **options)


Send = Callable[..., Goal]


def test_a_goal_has_feedback_and_a_result(serve: MakeServer, send: Send, spin_until: SpinUntil) -> None:
    serve()
    goal = send(3)
    assert goal.handle().accepted
    assert goal.handle().stamp.sec > 0
    response = goal.result()
    assert (response.status, list(response.result.sequence)) == (SUCCEEDED, [0, 1, 1, 2, 3])
    assert goal.feedback == [[0, 1, 1], [0, 1, 1, 2], [0, 1, 1, 2, 3]]
    spin_until(lambda: goal.handle().status == SUCCEEDED)


def test_a_goal_is_cancelled(serve: MakeServer, send: Send, task: Task, spin_until: SpinUntil) -> None:
    serve(task, cancel_callback=accept_cancel)
    goal = send()
    spin_until(lambda: goal.future.done() and task.goals)
    assert not task.goals[0].is_cancel_requested
    response = goal.cancel()
    assert response.return_code == CancelGoal.Response.ERROR_NONE
    assert [info.goal_id for info in response.goals_canceling] == [goal.handle().goal_id]
    assert task.goals[0].is_cancel_requested
    assert task.goals[0].status == GoalStatus.STATUS_CANCELING
    task.end(0, ServerGoalHandle.canceled)
    response = goal.result()
    assert (response.status, list(response.result.sequence)) == (CANCELED, [3])


def test_a_goal_that_is_being_cancelled_may_still_succeed(
    serve: MakeServer, send: Send, task: Task, spin_until: SpinUntil
) -> None:
    serve(task, cancel_callback=accept_cancel)
    goal = send()
    spin_until(lambda: task.goals)
    goal.cancel()
    task.end(0, ServerGoalHandle.succeed)
    assert goal.result().status == SUCCEEDED


def test_a_goal_may_be_cancelled_before_its_execution(
    serve: MakeServer, send: Send, spin_until: SpinUntil
) -> None:
    accepted: list[ServerGoalHandle] = []

    def execute(goal_handle: ServerGoalHandle) -> Fibonacci.Result:
        goal_handle.canceled()
        return Fibonacci.Result()

    serve(execute, handle_accepted_callback=accepted.append, cancel_callback=accept_cancel)
    goal = send()
    assert len(goal.cancel().goals_canceling) == 1
    accepted[0].execute()
    assert goal.result().status == CANCELED


def test_several_goals_run_at_once(serve: MakeServer, send: Send, task: Task, spin_until: SpinUntil) -> None:
    serve(task)
    goals = [send(order) for order in (4, 5, 6)]
    spin_until(lambda: len(task.goals) == 3)
    by_order = {goal_handle.request.order: index for index, goal_handle in enumerate(task.goals)}
    results = [goal.handle().get_result_async() for goal in goals]
    task.end(by_order[6], ServerGoalHandle.succeed)
    spin_until(results[2].done)
    assert not results[0].done()
    task.goals[by_order[5]].publish_feedback(Fibonacci.Feedback(sequence=[55]))
    spin_until(lambda: goals[1].feedback)
    task.end(by_order[4], ServerGoalHandle.abort)
    task.end(by_order[5], ServerGoalHandle.succeed)
    spin_until(lambda: all(result.done() for result in results))
    found = [(result.result().status, *result.result().result.sequence) for result in results]
    assert found == [(ABORTED, 4), (SUCCEEDED, 5), (SUCCEEDED, 6)]
    assert [goal.feedback for goal in goals] == [[], [[55]], []]


def test_a_second_goal_with_the_same_uuid_is_rejected(serve: MakeServer, send: Send, node: Node) -> None:
    serve(handle_accepted_callback=keep)
    goal_id = UUID(uuid=list(uuid.uuid4().bytes))
    assert send(goal_uuid=goal_id).handle().accepted
    assert not send(goal_uuid=goal_id).handle().accepted


def test_invalid_changes_of_state_are_errors(serve: MakeServer, send: Send, spin_until: SpinUntil) -> None:
    accepted: list[ServerGoalHandle] = []
    serve(handle_accepted_callback=accepted.append)
    goal = send()
    assert goal.handle().accepted
    spin_until(lambda: accepted)
    for change in (ServerGoalHandle.succeed, ServerGoalHandle.canceled, ServerGoalHandle.abort):
        with pytest.raises(rclpy_implementation.RCLError, match="invalid transition from state ACCEPTED"):
            change(accepted[0])
    accepted[0].execute()
    assert goal.result().status == SUCCEEDED
    with pytest.raises(rclpy_implementation.RCLError, match="from state SUCCEEDED with event ABORT"):
        accepted[0].abort()
    assert not accepted[0].is_active


@pytest.mark.parametrize("name", ["", "with space", "1st", "a//b"])
def test_an_action_needs_a_valid_name(node: Node, name: str) -> None:
    with pytest.raises(ValueError, match="Failed to create action client"):
        ActionClient(node, Fibonacci, name)
    with pytest.raises(ValueError, match="Failed to create action server"):
        ActionServer(node, Fibonacci, name, fibonacci)


# Requests to cancel that select goals by UUID and stamp

Cancel = Callable[[GoalInfo], Response]


@pytest.fixture
def cancel(client: ActionClient, make_node: MakeNode, spin_until: SpinUntil) -> Cancel:
    """Sends a request to cancel and returns the response's code and the number of cancelled goals."""
    canceler = make_node("canceler")
    service = canceler.create_client(CancelGoal, "fibonacci/_action/cancel_goal")

    def cancel(goal_info: GoalInfo) -> Response:
        assert client.wait_for_server(timeout_sec=10)
        assert service.wait_for_service(timeout_sec=10)
        future = service.call_async(CancelGoal.Request(goal_info=goal_info))
        executor = SingleThreadedExecutor(context=canceler.context)
        executor.add_node(canceler)
        spin_until(lambda: executor.spin_once(0.0) or future.done())
        executor.shutdown()
        return future.result().return_code, len(future.result().goals_canceling)

    return cancel


def test_a_request_without_uuid_and_stamp_cancels_all_goals(
    serve: MakeServer, send: Send, task: Task, cancel: Cancel, spin_until: SpinUntil
) -> None:
    serve(task, cancel_callback=accept_cancel)
    goals = [send(), send(), send()]
    spin_until(lambda: len(task.goals) == 3)
    task.end(0, ServerGoalHandle.succeed)
    spin_until(goals[0].handle().get_result_async().done)
    assert cancel(GoalInfo()) == (CancelGoal.Response.ERROR_NONE, 2)
    assert [goal_handle.is_cancel_requested for goal_handle in task.goals] == [False, True, True]
    assert cancel(GoalInfo()) == (CancelGoal.Response.ERROR_NONE, 0)


def test_a_request_with_a_stamp_cancels_the_goals_until_then(
    serve: MakeServer, send: Send, task: Task, cancel: Cancel, node: Node, spin_until: SpinUntil
) -> None:
    serve(task, cancel_callback=accept_cancel)
    goals = [send(), send()]
    spin_until(lambda: len(task.goals) == 2)
    # Not the stamp of a handle: rclpy takes that before it accepts the goal.
    stamp = node.get_clock().now().to_msg()
    goals.append(send())
    spin_until(lambda: len(task.goals) == 3)
    assert cancel(GoalInfo(stamp=stamp)) == (CancelGoal.Response.ERROR_NONE, 2)
    (left,) = (goal_handle for goal_handle in task.goals if not goal_handle.is_cancel_requested)
    assert cancel(GoalInfo(stamp=stamp, goal_id=left.goal_id)) == (CancelGoal.Response.ERROR_NONE, 1)


def test_cancelling_an_unknown_or_ended_goal_is_refused(
    serve: MakeServer, send: Send, cancel: Cancel
) -> None:
    serve(cancel_callback=accept_cancel)
    unknown = GoalInfo(goal_id=UUID(uuid=list(uuid.uuid4().bytes)))
    assert cancel(unknown) == (CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID, 0)
    goal = send()
    assert goal.result().status == SUCCEEDED
    ended = GoalInfo(goal_id=goal.handle().goal_id)
    assert cancel(ended) == (CancelGoal.Response.ERROR_GOAL_TERMINATED, 0)


# Results and states of the past


def test_a_result_expires(serve: MakeServer, send: Send, spin_until: SpinUntil) -> None:
    serve(result_timeout=0.3)
    goal = send()
    assert goal.result().status == SUCCEEDED
    spin_until(lambda: goal.result().status == GoalStatus.STATUS_UNKNOWN)
    assert send(goal_uuid=goal.handle().goal_id).handle().accepted


def test_a_negative_result_timeout_is_an_error(serve: MakeServer) -> None:
    with pytest.raises(ValueError, match="Failed to create action server"):
        serve(result_timeout=-1)


def test_a_late_subscription_gets_the_states_of_all_goals(
    serve: MakeServer, send: Send, node: Node, spin_until: SpinUntil
) -> None:
    serve()
    goals = [send(), send()]
    for goal in goals:
        goal.result()
    messages: list[GoalStatusArray] = []
    node.create_subscription(
        GoalStatusArray, "fibonacci/_action/status", messages.append, qos_profile_action_status_default
    )
    spin_until(lambda: messages)
    found = {bytes(one.goal_info.goal_id.uuid): one.status for one in messages[-1].status_list}
    assert found == {bytes(goal.handle().goal_id.uuid): SUCCEEDED for goal in goals}


# Waiting and blocking


def test_waiting_for_a_server_ends_with_it_or_with_the_timeout(
    serve: MakeServer, client: ActionClient, spin_until: SpinUntil
) -> None:
    assert not client.server_is_ready()
    assert not client.wait_for_server(timeout_sec=0.01)
    server = serve()
    assert client.wait_for_server(timeout_sec=10)
    assert client.server_is_ready()
    server.destroy()
    spin_until(lambda: not client.server_is_ready())


def test_blocking_calls_work_while_another_thread_spins(make_node: MakeNode, context: Context) -> None:
    node = make_node()
    group = ReentrantCallbackGroup()
    answered = threading.Event()

    def execute(goal_handle: ServerGoalHandle) -> Fibonacci.Result:
        if goal_handle.request.order < 0:
            while not goal_handle.is_cancel_requested:
                threading.Event().wait(0.01)
            goal_handle.canceled()
            return Fibonacci.Result()
        return fibonacci(goal_handle)

    server = ActionServer(
        node, Fibonacci, "fibonacci", execute, callback_group=group, cancel_callback=accept_cancel
    )
    client = ActionClient(node, Fibonacci, "fibonacci", callback_group=group)
    with spinning(MultiThreadedExecutor(4, context=context), node):
        assert client.wait_for_server(timeout_sec=10)
        feedback: list[Any] = []
        response = client.send_goal(Fibonacci.Goal(order=1), feedback_callback=feedback.append)
        sent = client.send_goal_async(Fibonacci.Goal(order=-1))
        sent.add_done_callback(lambda _: answered.set())
        assert answered.wait(10)
        cancelled = sent.result().cancel_goal()
        end = sent.result().get_result()
    assert (response.status, list(response.result.sequence)) == (SUCCEEDED, [0, 1, 1])
    assert len(cancelled.goals_canceling) == 1
    assert end.status == CANCELED
    client.destroy()
    server.destroy()


def test_clients_and_servers_are_waitables_of_their_nodes(
    serve: MakeServer, client: ActionClient, node: Node, make_node: MakeNode
) -> None:
    server = serve()
    assert server in list(node.waitables)
    assert server.action_type is Fibonacci
    entities = server.get_num_entities()
    assert (entities.num_timers, entities.num_services) == (1, 3)
    entities = client.get_num_entities()
    assert (entities.num_subscriptions, entities.num_clients) == (2, 3)
    assert list(node.services)
    assert not [one for one in node.services if "_action" in one.srv_name]
    server.destroy()
    assert server not in list(node.waitables)
