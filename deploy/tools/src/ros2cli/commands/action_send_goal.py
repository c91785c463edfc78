"""`ros2 action send_goal`."""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from ros2cli import graph
from ros2cli.options import check, parsed_yaml, values_argument

if TYPE_CHECKING:
    from rclpy.action.client import ClientGoalHandle
    from rclpy.node import Node
    from rclpy.task import Future

CANCEL_TIMEOUT = 5.0  # s


@click.command
@click.argument("action_name")
@click.argument("action_type")
@values_argument("goal", "Read the goal from standard input.")
@click.option("-f", "--feedback", is_flag=True, help="Echo feedback messages for the goal.")
def send_goal(action_name: str, action_type: str, goal: str, feedback: bool) -> None:
    """Send an action goal.

    GOAL fills the goal, in YAML ("{order: 10}"). It waits for the server, and then for the result. Ctrl-C
    cancels the goal.
    """
    from action_msgs.msg import GoalStatus
    from rclpy.action import ActionClient

    from rosidl_runtime_py import message_to_yaml, set_message_fields

    class_ = graph.interface_class("action", action_type, "The passed action type is invalid")
    message = class_.Goal()
    try:
        set_message_fields(message, parsed_yaml(goal))
        check(message)
    except Exception as error:
        raise click.ClickException(f"Failed to populate message fields: {error!r}") from None

    def report(message: Any) -> None:
        click.echo(f"Feedback:\n    {message_to_yaml(message.feedback)}")

    name = f"{graph.NODE_NAME_PREFIX}_send_goal_{action_type.replace('/', '_')}"
    with graph.node(name=name) as node:
        client = ActionClient(node, class_, graph.full_topic_name(node, action_name))
        click.echo("Waiting for an action server to become available...")
        while not client.wait_for_server(timeout_sec=1.0):
            pass
        click.echo(f"Sending goal:\n     {message_to_yaml(message)}")
        sent: list[Future] = []

        def send() -> None:
            sent.append(client.send_goal_async(message, report if feedback else None))

        try:
            _uninterrupted(send)
            graph.spin(node, sent[0])
            handle = sent[0].result()
            if not handle.accepted:
                click.echo("Goal was rejected.")
                return
            click.echo(f"Goal accepted with ID: {bytes(handle.goal_id.uuid).hex()}\n")
            ending = handle.get_result_async()
            graph.spin(node, ending)
        except BaseException:  # Ctrl-C above all: whenever it comes, the goal must not continue
            if sent:
                _cancel(node, sent[0])
            raise
        result = ending.result()
        click.echo(f"Result:\n    {message_to_yaml(result.result)}")
        states = {value: state for state, value in vars(GoalStatus).items() if state.startswith("STATUS_")}
        state = states[result.status].removeprefix("STATUS_")
        click.echo(f"Goal finished with status: {state}")


def _uninterrupted(action: Callable[[], object]) -> None:
    """Run an action to its end; a signal that ends the command waits for that."""
    came: list[int] = []
    signals = (signal.SIGINT, signal.SIGTERM)
    handlers = {each: signal.signal(each, lambda number, _: came.append(number)) for each in signals}
    try:
        action()
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    if came:
        signal.raise_signal(came[0])


def _cancel(node: Node, accepting: Future) -> None:
    if not accepting.done():
        graph.spin(node, accepting, CANCEL_TIMEOUT)
    handle: ClientGoalHandle | None = accepting.result()
    if handle is None:
        raise click.ClickException("Failed to cancel goal: the action server does not answer")
    if not handle.accepted:
        return
    canceling = handle.cancel_goal_async()
    click.echo("Canceling goal...")
    graph.spin(node, canceling, CANCEL_TIMEOUT)
    if not canceling.done() or not canceling.result().goals_canceling:
        raise click.ClickException("Failed to cancel goal")
    click.echo("Goal canceled.")
