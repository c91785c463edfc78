"""`ros2 node list` and `ros2 node info`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from ros2cli import graph
from ros2cli.options import strategy_options

if TYPE_CHECKING:
    from rclpy.node import Node

_NamesAndTypes = list[tuple[str, list[str]]]


@click.command("list")
@strategy_options
@click.option("-a", "--all", "show_all", is_flag=True, help="Display all nodes even hidden ones.")
@click.option("-c", "--count-nodes", is_flag=True, help="Only display the number of nodes discovered.")
def list_nodes(spin_time: float, use_sim_time: bool, show_all: bool, count_nodes: bool) -> None:
    """Output a list of available nodes."""
    with graph.node(spin_time, use_sim_time=use_sim_time) as node:
        names = sorted(name.full_name for name in graph.node_names(node, include_hidden=show_all))
    if count_nodes:
        click.echo(len(names))
        return
    if len(set(names)) < len(names):
        click.echo(
            "WARNING: Be aware that there are nodes in the graph that share an exact name,"
            " which can have unintended side effects.",
            err=True,
        )
    for name in names:
        click.echo(name)


@click.command
@strategy_options
@click.argument("node_name")
@click.option("--include-hidden", is_flag=True, help="Display hidden topics, services, and actions as well.")
def info(spin_time: float, use_sim_time: bool, node_name: str, include_hidden: bool) -> None:
    """Output information about a node."""
    with graph.node(spin_time, use_sim_time=use_sim_time) as node:
        names = graph.node_names(node, include_hidden=include_hidden)
        found = [name for name in names if name.full_name == node_name]
        if not found:
            raise click.ClickException(f"Unable to find node '{node_name}'")
        sections = _sections(node, found[0])
    if len(found) > 1:
        click.echo(
            f'There are {len(found)} nodes in the graph with the exact name "{node_name}". '
            "You are seeing information about only one of them.",
            err=True,
        )
    click.echo(node_name)
    for title, entities in sections.items():
        shown = [
            f"    {name}: {', '.join(types)}"
            for name, types in entities
            if include_hidden or not graph.is_hidden(name)
        ]
        click.echo("\n".join([f"  {title}:", *(shown or [""])]))


def _sections(node: Node, name: graph.NodeName) -> dict[str, _NamesAndTypes]:
    """What the node has in the graph, by the title of its kind."""
    from rclpy import action

    whose = name.name, name.namespace
    return {
        "Subscribers": node.get_subscriber_names_and_types_by_node(*whose),
        "Publishers": node.get_publisher_names_and_types_by_node(*whose),
        "Service Servers": node.get_service_names_and_types_by_node(*whose),
        "Service Clients": node.get_client_names_and_types_by_node(*whose),
        "Action Servers": action.get_action_server_names_and_types_by_node(node, *whose),
        "Action Clients": action.get_action_client_names_and_types_by_node(node, *whose),
    }
