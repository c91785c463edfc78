from __future__ import annotations

import re
import signal
import threading
from collections.abc import Iterator
from typing import Any

import pytest
from deploy.tools.tests.cli.conftest import in_domain
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.node import Node

try:
    from example_interfaces.action import Fibonacci
except ModuleNotFoundError:  # ROS 2's wheels
    from test_msgs.action import Fibonacci

PACKAGE = Fibonacci.__module__.partition(".")[0]
TYPE = f"{PACKAGE}/action/Fibonacci"
ACCEPTED = r"Goal accepted with ID: [0-9a-f]{32}\n\n"
SENDING = "Waiting for an action server to become available...\nSending goal:\n     order: {}\n\n"


class Server(Node):
    """Serves Fibonacci: it rejects order 0, aborts order 1, and waits for the cancellation of order 99."""

    def __init__(self, context: Context) -> None:
        super().__init__("server", context=context)
        self.begun = threading.Event()
        self.canceled = threading.Event()
        self.is_ending = False
        ActionServer(
            self,
            Fibonacci,
            "fibonacci",
            self._execute,
            goal_callback=lambda goal: GoalResponse.ACCEPT if goal.order else GoalResponse.REJECT,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )

    def _execute(self, goal: Any) -> Fibonacci.Result:
        if goal.request.order == 1:
            goal.abort()
        elif goal.request.order == 99:
            self.begun.set()
            while not goal.is_cancel_requested and not self.is_ending:
                self.canceled.wait(0.01)
            goal.canceled()
            self.canceled.set()
        else:
            goal.publish_feedback(Fibonacci.Feedback(sequence=[0]))
            goal.succeed()
        return Fibonacci.Result(sequence=[0, 1])


@pytest.fixture(scope="module")
def server(module_domain_id: int) -> Iterator[Server]:
    with in_domain(Server, module_domain_id) as server:
        yield server
        server.is_ending = True


@pytest.mark.own  # ROS 2 starts its daemon
def test_list_and_info_show_actions(server: Server, ros2: Any) -> None:
    assert ros2("action", "list").stdout == "/fibonacci\n"
    assert ros2("action", "list", "-t").stdout == f"/fibonacci [{TYPE}]\n"
    assert ros2("action", "list", "-c").stdout == "1\n"
    assert ros2("action", "info", "/fibonacci", "-t").stdout == (
        f"Action: /fibonacci\nAction clients: 0\nAction servers: 1\n    /server [{TYPE}]\n"
    )


def test_goal_succeeds_with_feedback_and_result(server: Server, ros2: Any) -> None:
    done = ros2("action", "send_goal", "-f", "/fibonacci", TYPE, "{order: 3}")
    feedback = r"Feedback:\n    sequence:\n- 0\n\n"
    result = r"Result:\n    sequence:\n- 0\n- 1\n\nGoal finished with status: SUCCEEDED\n"
    # the server may send the feedback before its acceptance arrives
    ends = [ACCEPTED + feedback, feedback + ACCEPTED]
    assert done.stdout.startswith(SENDING.format(3))
    rest = done.stdout.removeprefix(SENDING.format(3))
    assert any(re.fullmatch(end + result, rest) for end in ends), rest
    assert done.returncode == 0


@pytest.mark.parametrize(
    ("order", "end"),
    [
        (0, "Goal was rejected.\n"),
        (1, ACCEPTED + r"Result:\n    sequence:\n- 0\n- 1\n\nGoal finished with status: ABORTED\n"),
    ],
)
def test_goal_may_be_rejected_or_aborted(server: Server, ros2: Any, order: int, end: str) -> None:
    short = f"{PACKAGE}/Fibonacci"
    out = ros2("action", "send_goal", "/fibonacci", short, f"{{order: {order}}}").stdout
    assert re.fullmatch(re.escape(SENDING.format(order)) + end, out)


@pytest.mark.own  # in ROS 2, the signal ends the node before the goal is canceled
@pytest.mark.parametrize("line", ["Sending goal:", "Goal accepted"])
def test_ctrl_c_cancels_the_goal(server: Server, start: Any, line: str) -> None:
    server.begun.clear()
    server.canceled.clear()
    process = start("action", "send_goal", "/fibonacci", TYPE, "{order: 99}")
    while not (read := process.stdout.readline()).startswith(line):
        assert read, process.stderr.read()
    process.send_signal(signal.SIGINT)
    rest = process.stdout.read()
    assert process.stderr.read() == ""
    assert process.wait(10) == 2
    if line == "Goal accepted" or server.begun.is_set():  # Ctrl-C may come before the goal is sent
        assert rest.endswith("Canceling goal...\nGoal canceled.\n")
        assert server.canceled.wait(10)
    assert server.begun.is_set() == server.canceled.is_set()
