"""Calls the parameter services of another node."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from ros2cli import graph

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.parameter_client import AsyncParameterClient
    from rclpy.task import Future

_SERVICES_TIMEOUT = 5.0
"""How long the services of a node that was found may take to appear [s]."""


def full_name(node_name: str) -> str:
    """Return the name of a node with its leading slash."""
    return node_name if node_name.startswith("/") else f"/{node_name}"


@contextmanager
def client(
    node_name: str, *, include_hidden_nodes: bool, timeout: float, spin_time: float, use_sim_time: bool
) -> Iterator[AsyncParameterClient]:
    """A client of a node, looked for `timeout` [s], and at least `spin_time`. Raises ClickException."""
    name = full_name(node_name)
    with graph.node(use_sim_time=use_sim_time) as node:

        def found() -> bool:
            names = graph.node_names(node, include_hidden=include_hidden_nodes)
            return any(one.full_name == name for one in names)

        if not graph.wait_for(found, timeout if timeout < 0 else max(timeout, spin_time)):
            raise click.ClickException("Node not found")
        made = client_of(node, name)
        if made is None:
            raise click.ClickException(
                f"Wait for service timed out waiting for parameter services for node {node_name}"
            )
        yield made


def client_of(node: Node, full_name: str) -> AsyncParameterClient | None:
    """Return a client for the parameters of a node; ``None`` if its services do not appear."""
    from rclpy.parameter_client import AsyncParameterClient

    made = AsyncParameterClient(node, full_name)
    return made if made.wait_for_services(_SERVICES_TIMEOUT) else None


def response(client: AsyncParameterClient, future: Future) -> Any:
    """Wait for the response to a call. Raises ClickException if the node ends meanwhile."""
    name = client.remote_node_name
    while not future.done():
        graph.spin(client.node, future, 0.5)
        if not future.done() and not client.services_are_ready():
            raise click.ClickException(f"Exception while calling service of node {name}: it has ended")
    return future.result()


def type_name(number: int) -> str:
    """Return the name of a type of parameters, such as ``double``, by its number in messages."""
    from rclpy.parameter import Parameter

    name = Parameter.Type(number).name.lower().replace("_", " ")
    return name.replace("bool", "boolean")
