"""`ros2 param list`."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import click

from ros2cli import graph, parameters
from ros2cli.options import ManyValues, VerbWithManyValues, strategy_options

if TYPE_CHECKING:
    from rclpy.parameter_client import AsyncParameterClient


@click.command("list", cls=VerbWithManyValues)
@strategy_options
@click.argument("node_name", required=False)
@click.option("--filter", "pattern", help="Only show parameters that match this regular expression.")
@click.option("--include-hidden-nodes", is_flag=True, help="Consider hidden nodes as well.")
@click.option("--param-prefixes", cls=ManyValues, help="Only list parameters with these prefixes.")
@click.option("--param-type", is_flag=True, help="Print parameter types with parameter names.")
def list_parameters(
    spin_time: float,
    use_sim_time: bool,
    node_name: str | None,
    pattern: str | None,
    include_hidden_nodes: bool,
    param_prefixes: tuple[str, ...],
    param_type: bool,
) -> None:
    """Output a list of available parameters."""
    try:
        wanted = re.compile(pattern or "")
    except re.error as error:
        raise click.ClickException(f"'{pattern}' is no regular expression: {error}") from None
    with graph.node(spin_time, use_sim_time=use_sim_time) as node:
        nodes = sorted(set(graph.node_names(node, include_hidden=include_hidden_nodes)))
        if node_name:
            nodes = [one for one in nodes if one.full_name == parameters.full_name(node_name)]
            if not nodes:
                raise click.ClickException("Node not found")
        for one in nodes:
            client = parameters.client_of(node, one.full_name)
            if client is None:
                click.echo(
                    f"Wait for service timed out waiting for parameter services for node {one.full_name}"
                )
                continue
            listed = parameters.response(client, client.list_parameters(list(param_prefixes)))
            names = [name for name in sorted(listed.result.names) if wanted.match(name)]
            if names and not node_name:
                click.echo(f"{one.full_name}:")
            types = _types(client, names) if param_type else {}
            for name in names:
                click.echo(f"  {name} (type: {types[name]})" if param_type else f"  {name}")


def _types(client: AsyncParameterClient, names: list[str]) -> dict[str, str]:
    descriptors = parameters.response(client, client.describe_parameters(names)).descriptors
    return {one.name: parameters.type_name(one.type) for one in descriptors}
