"""`ros2 action list` and `ros2 action info`."""

from __future__ import annotations

import click

from ros2cli import graph
from ros2cli.options import strategy_options


@click.command("list")
@strategy_options
@click.option("-t", "--show-types", is_flag=True, help="Additionally show the action type.")
@click.option("-c", "--count-actions", is_flag=True, help="Only display the number of actions discovered.")
def list_actions(spin_time: float, use_sim_time: bool, show_types: bool, count_actions: bool) -> None:
    """Output a list of action names."""
    from rclpy.action import get_action_names_and_types

    with graph.node(spin_time, use_sim_time=use_sim_time) as node:
        actions = get_action_names_and_types(node)
    if count_actions:
        click.echo(len(actions))
        return
    for name, types in actions:
        click.echo(f"{name} [{', '.join(types)}]" if show_types else name)


@click.command
@strategy_options
@click.argument("action_name")
@click.option("-t", "--show-types", is_flag=True, help="Additionally show the action type.")
@click.option("-c", "--count", is_flag=True, help="Only display the number of action clients and servers.")
def info(spin_time: float, use_sim_time: bool, action_name: str, show_types: bool, count: bool) -> None:
    """Print information about an action."""
    from rclpy import action

    with graph.node(spin_time, use_sim_time=use_sim_time) as node:
        full_name = graph.full_topic_name(node, action_name)
        nodes = graph.node_names(node, include_hidden=True)
        clients, servers = (
            [
                (one.full_name, actions[full_name])
                for one in nodes
                if full_name in (actions := dict(ask(node, one.name, one.namespace)))
            ]
            for ask in (
                action.get_action_client_names_and_types_by_node,
                action.get_action_server_names_and_types_by_node,
            )
        )
    click.echo(f"Action: {action_name}")
    for title, owners in (("Action clients", clients), ("Action servers", servers)):
        click.echo(f"{title}: {len(owners)}")
        for name, types in [] if count else owners:
            click.echo(f"    {name} [{', '.join(types)}]" if show_types else f"    {name}")
