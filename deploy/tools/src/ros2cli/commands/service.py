"""`ros2 service list`, `type` and `call`."""

from __future__ import annotations

import time

import click

from ros2cli import graph
from ros2cli.options import POSITIVE_FLOAT, fill, strategy_options, values_argument


@click.command("list")
@strategy_options
@click.option("-t", "--show-types", is_flag=True, help="Additionally show the service type.")
@click.option("-c", "--count-services", is_flag=True, help="Only display the number of services discovered.")
@click.option("--include-hidden-services", is_flag=True, help="Consider hidden services as well.")
@click.pass_context
def list_services(
    context: click.Context,
    spin_time: float,
    use_sim_time: bool,
    show_types: bool,
    count_services: bool,
    include_hidden_services: bool,
) -> None:
    """Output a list of available services."""
    services = _services(context, spin_time, use_sim_time, include_hidden_services)
    if count_services:
        click.echo(len(services))
        return
    for name, types in services:
        click.echo(f"{name} [{', '.join(types)}]" if show_types else name)


@click.command("type")
@strategy_options
@click.argument("service_name")
@click.pass_context
def show_type(context: click.Context, spin_time: float, use_sim_time: bool, service_name: str) -> None:
    """Output a service's type. Exit code 1 if there is no such service."""
    types = dict(_services(context, spin_time, use_sim_time)).get(service_name)
    if types is None:
        raise click.exceptions.Exit(1)
    for type_ in types:
        click.echo(type_)


def _services(
    context: click.Context, spin_time: float, use_sim_time: bool, include_hidden: bool = False
) -> list[tuple[str, list[str]]]:
    include_hidden |= bool(context.parent and context.parent.params["include_hidden_services"])
    with graph.node(spin_time, use_sim_time=use_sim_time) as node:
        found = node.get_service_names_and_types()
    return [(name, types) for name, types in found if include_hidden or not graph.is_hidden(name)]


@click.command
@click.argument("service_name")
@click.argument("service_type")
@values_argument("values", "Read values from standard input.")
@click.option("-r", "--rate", metavar="N", type=POSITIVE_FLOAT, help="Repeat the call at this rate in Hz.")
def call(service_name: str, service_type: str, values: str, rate: float | None) -> None:
    """Call a service.

    VALUES fill the request, in YAML ("{a: 1, b: 2}"); other fields keep their defaults. It waits until the
    service is available.
    """
    class_ = graph.interface_class("service", service_type, "The passed service type is invalid")
    request = class_.Request()
    fill(request, values)
    package, *_, name = service_type.split("/")
    with graph.node(name=f"{graph.NODE_NAME_PREFIX}_requester_{package}_{name}") as node:
        client = node.create_client(class_, service_name)
        if not client.service_is_ready():
            click.echo("waiting for service to become available...")
            while not client.wait_for_service(timeout_sec=1.0):
                pass
        while True:
            click.echo(f"requester: making request: {request!r}\n")
            began = time.monotonic()
            future = client.call_async(request)
            graph.spin(node, future)
            click.echo(f"response:\n{future.result()!r}\n")
            if rate is None:
                return
            time.sleep(max(0.0, began + 1.0 / rate - time.monotonic()))
