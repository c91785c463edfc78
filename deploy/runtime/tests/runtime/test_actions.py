"""Actions: what other processes send, errors of programs, what a process must not pay."""

from __future__ import annotations

import threading
from typing import Any

import pytest
from deploy.runtime.tests.nodes import MakeNode, SpinUntil

from action_msgs.msg import GoalStatus
from example_interfaces.action import Fibonacci
from example_interfaces.srv import AddTwoInts
from rclpy._dds.library import blocking
from rclpy.action import ActionClient, ActionServer
from rclpy.action._endpoints import uuid_bytes
from rclpy.action.server import ServerGoalHandle
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time


def succeed(goal_handle: ServerGoalHandle) -> Fibonacci.Result:
    goal_handle.succeed()
    return Fibonacci.Result()


def test_two_processes_share_an_action(
    node: Node, executor: SingleThreadedExecutor, other_context: Context, spin_until: SpinUntil
) -> None:
    def execute(goal_handle: ServerGoalHandle) -> Fibonacci.Result:
        for _ in range(5):
            goal_handle.publish_feedback(Fibonacci.Feedback(sequence=[1]))
        return succeed(goal_handle)

    there = Node("there", context=other_context)
    server = ActionServer(there, Fibonacci, "fibonacci", execute)
    client = ActionClient(node, Fibonacci, "fibonacci")
    with SingleThreadedExecutor(context=other_context) as other_executor:
        other_executor.add_node(there)

        def wait(future: Any) -> Any:
            spin_until(lambda: other_executor.spin_once(0.0) or future.done())
            return future.result()

        assert client.wait_for_server(timeout_sec=10)
        heard: list[Any] = []
        goal_handle = wait(client.send_goal_async(Fibonacci.Goal(), heard.append))
        assert wait(goal_handle.get_result_async()).status == GoalStatus.STATUS_SUCCEEDED
        spin_until(lambda: len(heard) == 5)
    server.destroy()
    there.destroy_node()


def test_feedback_that_arrived_before_the_result_is_not_lost(
    make_node: MakeNode, node: Node, context: Context, spin_until: SpinUntil
) -> None:
    goals: list[ServerGoalHandle] = []

    def execute(goal_handle: ServerGoalHandle) -> Fibonacci.Result:
        for number in range(5):
            goal_handle.publish_feedback(Fibonacci.Feedback(sequence=[number]))
        return succeed(goal_handle)

    server = ActionServer(node, Fibonacci, "fibonacci", execute, handle_accepted_callback=goals.append)
    asker = make_node("asker")
    client = ActionClient(asker, Fibonacci, "fibonacci")
    assert client.wait_for_server(timeout_sec=10)
    heard: list[int] = []
    sent = client.send_goal_async(Fibonacci.Goal(), lambda message: heard.extend(message.feedback.sequence))
    with SingleThreadedExecutor(context=context) as other_executor:
        other_executor.add_node(asker)
        spin_until(lambda: other_executor.spin_once(0.0) or (sent.done() and goals))
        future = sent.result().get_result_async()
        goals[0].execute()
        spin_until(lambda: server._result_futures[uuid_bytes(goals[0].goal_id)].done())
        spin_until(lambda: blocking.dds_triggered(client._rclpy_result_calls._rclpy_handles[0]))
        other_executor.spin_until_future_complete(future, 10)
    assert heard == [0, 1, 2, 3, 4]


def test_the_endpoints_of_an_action_carry_type_hashes(node: Node, spin_until: SpinUntil) -> None:
    ActionServer(node, Fibonacci, "fibonacci", succeed)
    spin_until(lambda: node.count_services("fibonacci/_action/get_result"))
    topics = {
        "rt/fibonacci/_action/feedback": ("Fibonacci_FeedbackMessage_", Fibonacci.Impl.FeedbackMessage),
        "rr/fibonacci/_action/send_goalReply": (
            "Fibonacci_SendGoal_Response_",
            Fibonacci.Impl.SendGoalService.Response,
        ),
        "rr/fibonacci/_action/get_resultReply": (
            "Fibonacci_GetResult_Response_",
            Fibonacci.Impl.GetResultService.Response,
        ),
    }
    announced = dict(node.get_topic_names_and_types(no_demangle=True))
    for topic, (dds_name, cls) in topics.items():
        assert announced[topic] == [f"example_interfaces::action::dds_::{dds_name}"]
        (info,) = node.get_publishers_info_by_topic(topic, no_mangle=True)
        assert str(info.topic_type_hash) == cls._TYPE_HASH


def test_a_malformed_goal_is_dropped(node: Node, spin_until: SpinUntil) -> None:
    server = ActionServer(node, Fibonacci, "fibonacci", succeed)
    client = ActionClient(node, Fibonacci, "fibonacci")
    assert client.wait_for_server(timeout_sec=10)
    client._rclpy_goal_calls.handle.write(b"\0\1\0\0" + bytes(20))
    future = client.send_goal_async(Fibonacci.Goal())
    spin_until(future.done)
    assert future.result().accepted
    assert server._rclpy_goal_service._rclpy_bad_input.count == 1


def test_a_second_server_of_an_action_is_reported(
    node: Node, spin_until: SpinUntil, capfd: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):
        ActionServer(node, Fibonacci, "fibonacci", succeed)
    client = ActionClient(node, Fibonacci, "fibonacci")
    spin_until(lambda: client._rclpy_goal_calls.handle.matched() == 2)
    client.send_goal_async(Fibonacci.Goal())
    text = "There may be more than one action server for the action '/fibonacci'"
    log = ""

    def reported() -> bool:
        nonlocal log
        log += capfd.readouterr().err
        return text in log

    spin_until(reported)


@pytest.mark.parametrize(
    ("result", "reason"),
    [
        (None, "must return example_interfaces/action/Fibonacci_Result, not None"),
        ({"sequence": [1]}, "must return example_interfaces/action/Fibonacci_Result"),
    ],
)
def test_a_wrong_result_is_reported_and_answered(
    node: Node, spin_until: SpinUntil, capfd: pytest.CaptureFixture[str], result: Any, reason: str
) -> None:
    def execute(goal_handle: ServerGoalHandle) -> Any:
        goal_handle.succeed()
        return result

    ActionServer(node, Fibonacci, "fibonacci", execute)
    client = ActionClient(node, Fibonacci, "fibonacci")
    assert client.wait_for_server(timeout_sec=10)
    sent = client.send_goal_async(Fibonacci.Goal())
    spin_until(sent.done)
    future = sent.result().get_result_async()
    spin_until(future.done)
    assert future.result().status == GoalStatus.STATUS_SUCCEEDED
    assert list(future.result().result.sequence) == []
    assert reason in capfd.readouterr().err


def test_a_result_is_kept_from_the_end_of_its_goal_in_the_nodes_time(
    make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    node = make_node(parameter_overrides=[Parameter("use_sim_time", value=True)])
    executor.add_node(node)
    goals: list[ServerGoalHandle] = []
    server = ActionServer(
        node,
        Fibonacci,
        "fibonacci",
        succeed,
        handle_accepted_callback=goals.append,
        result_timeout=10,
    )
    client = ActionClient(node, Fibonacci, "fibonacci")
    assert client.wait_for_server(timeout_sec=10)
    advance = lambda seconds: node.get_clock().set_ros_time_override(  # noqa: E731
        Time(seconds=seconds, clock_type=node.get_clock().clock_type)
    )
    advance(100)
    sent = client.send_goal_async(Fibonacci.Goal())
    spin_until(lambda: sent.done() and goals)
    advance(200)
    goals[0].execute()
    spin_until(lambda: not goals[0].is_active)
    advance(209)
    for _ in range(3):
        executor.spin_once(0.01)
    assert list(server._goal_handles.values()) == goals
    advance(210)
    executor.wake()
    spin_until(lambda: not server._goal_handles)
    assert goals[0].status == GoalStatus.STATUS_UNKNOWN


def test_the_type_of_a_service_or_message_is_no_action(node: Node) -> None:
    for wrong in (AddTwoInts, Fibonacci.Goal):
        with pytest.raises(AttributeError, match="is not a ROS 2 action type"):
            ActionClient(node, wrong, "fibonacci")
        with pytest.raises(AttributeError, match="is not a ROS 2 action type"):
            ActionServer(node, wrong, "fibonacci", succeed)


def test_a_failed_creation_leaves_no_endpoints(node: Node, spin_until: SpinUntil) -> None:
    wrong: Any = "best effort"
    with pytest.raises(TypeError):
        ActionServer(node, Fibonacci, "fibonacci", succeed, status_pub_qos_profile=wrong)
    assert not [one for one in node.waitables if isinstance(one, ActionServer)]
    spin_until(lambda: not node.count_services("fibonacci/_action/send_goal"))


def test_a_finished_goal_is_forgotten_by_its_client(node: Node, spin_until: SpinUntil) -> None:
    ActionServer(node, Fibonacci, "fibonacci", succeed)
    client = ActionClient(node, Fibonacci, "fibonacci")
    assert client.wait_for_server(timeout_sec=10)
    sent = client.send_goal_async(Fibonacci.Goal(), lambda _: None)
    spin_until(sent.done)
    result = sent.result().get_result_async()
    spin_until(lambda: result.done() and sent.result().status == GoalStatus.STATUS_SUCCEEDED)
    assert (client._rclpy_goal_ids, client._goal_handles, client._feedback_callbacks) == ({}, {}, {})


def test_a_destroyed_server_starts_no_execution(
    node: Node, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    executed: list[ServerGoalHandle] = []
    goals: list[ServerGoalHandle] = []
    server = ActionServer(
        node, Fibonacci, "fibonacci", executed.append, handle_accepted_callback=goals.append
    )
    client = ActionClient(node, Fibonacci, "fibonacci")
    assert client.wait_for_server(timeout_sec=10)
    client.send_goal_async(Fibonacci.Goal())
    spin_until(lambda: goals)
    goals[0].execute()
    (task,) = server._rclpy_executions
    server.destroy()
    assert task.cancelled()
    executor.spin_once(0.0)
    assert (executed, server._rclpy_executions) == ([], set())


def test_a_cancelled_send_is_forgotten(node: Node) -> None:
    client = ActionClient(node, Fibonacci, "fibonacci")
    client.send_goal_async(Fibonacci.Goal(), lambda _: None).cancel()
    assert (client._rclpy_goal_ids, client._feedback_callbacks) == ({}, {})
    client.destroy()
    client.destroy()


def test_a_blocking_call_ends_with_the_context(context: Context, node: Node) -> None:
    client = ActionClient(node, Fibonacci, "fibonacci")
    threading.Timer(0.1, context.shutdown).start()
    assert client.send_goal(Fibonacci.Goal()) is None


def test_a_destroyed_node_takes_its_goals_along(
    make_node: MakeNode, node: Node, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    there = make_node("there")
    executor.add_node(there)
    accepted: list[ServerGoalHandle] = []
    ActionServer(there, Fibonacci, "fibonacci", succeed, handle_accepted_callback=accepted.append)
    client = ActionClient(node, Fibonacci, "fibonacci")
    assert client.wait_for_server(timeout_sec=10)
    client.send_goal_async(Fibonacci.Goal())
    spin_until(lambda: accepted)
    there.destroy_node()
    spin_until(lambda: not client.server_is_ready())
