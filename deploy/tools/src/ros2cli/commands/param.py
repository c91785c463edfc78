"""`ros2 param get`, `set`, `dump` and `describe`."""

from __future__ import annotations

from typing import Any

import click

from ros2cli import parameters
from ros2cli.options import check, node_options

_LABELS = {
    "BOOL": "Boolean value is:",
    "INTEGER": "Integer value is:",
    "DOUBLE": "Double value is:",
    "STRING": "String value is:",
    "BYTE_ARRAY": "Byte values are:",
    "BOOL_ARRAY": "Boolean values are:",
    "INTEGER_ARRAY": "Integer values are:",
    "DOUBLE_ARRAY": "Double values are:",
    "STRING_ARRAY": "String values are:",
}


@click.command
@node_options
@click.argument("node_name")
@click.argument("parameter_name")
@click.option("--hide-type", is_flag=True, help="Hide the type information.")
def get(node_name: str, parameter_name: str, hide_type: bool, **options: Any) -> None:
    """Get parameter."""
    from rclpy.parameter import Parameter, parameter_value_to_python

    with parameters.client(node_name, **options) as client:
        values = parameters.response(client, client.get_parameters([parameter_name])).values
    if not values:
        raise click.ClickException("Parameter not set")
    value = parameter_value_to_python(values[0])
    if hide_type:
        click.echo(str(value))
    elif value is None:
        click.echo("Parameter not set.")
    else:
        click.echo(f"{_LABELS[Parameter.Type(values[0].type).name]} {value}")


# A negative number is a value, not an option.
@click.command("set", context_settings={"ignore_unknown_options": True})
@node_options
@click.argument("node_name")
@click.argument("parameter_name")
@click.argument("value")
def set_parameter(node_name: str, parameter_name: str, value: str, **options: Any) -> None:
    """Set parameter."""
    from rcl_interfaces.msg import Parameter
    from rclpy.parameter import get_parameter_value

    try:
        parameter = Parameter(name=parameter_name, value=get_parameter_value(value))
        check(parameter)
    except Exception as error:
        raise click.ClickException(f"'{value}' cannot be the value of a parameter: {error}") from None
    with parameters.client(node_name, **options) as client:
        (result,) = parameters.response(client, client.set_parameters([parameter])).results
    outcome = "Set parameter successful" if result.successful else "Setting parameter failed"
    click.echo(f"{outcome}: {result.reason}" if result.reason else outcome, err=not result.successful)


@click.command
@node_options
@click.argument("node_name")
def dump(node_name: str, **options: Any) -> None:
    """Show all of the parameters of a node in a YAML file format."""
    import yaml

    from rclpy.parameter import PARAMETER_SEPARATOR_STRING, parameter_value_to_python

    with parameters.client(node_name, **options) as client:
        names = sorted(parameters.response(client, client.list_parameters()).result.names)
        values = parameters.response(client, client.get_parameters(names)).values
    tree: dict[str, Any] = {}
    for name, value in zip(names, values, strict=False):
        *branches, leaf = name.split(PARAMETER_SEPARATOR_STRING)
        place = tree
        for branch in branches:
            place = place.setdefault(branch, {})
        place[leaf] = parameter_value_to_python(value)
    document = {parameters.full_name(node_name): {"ros__parameters": tree}}
    click.echo(yaml.dump(document, default_flow_style=False))


@click.command
@node_options
@click.argument("node_name")
@click.argument("parameter_names", nargs=-1, required=True)
def describe(node_name: str, parameter_names: tuple[str, ...], **options: Any) -> None:
    """Show descriptive information about declared parameters."""
    with parameters.client(node_name, **options) as client:
        found = parameters.response(client, client.describe_parameters(list(parameter_names))).descriptors
    for descriptor in found:
        click.echo(f"Parameter name: {descriptor.name}")
        click.echo(f"  Type: {parameters.type_name(descriptor.type)}")
        if descriptor.description:
            click.echo(f"  Description: {descriptor.description}")
        click.echo("  Constraints:")
        if descriptor.read_only:
            click.echo("    Read only: true")
        for allowed in [*descriptor.floating_point_range, *descriptor.integer_range][:1]:
            click.echo(f"    Min value: {allowed.from_value}")
            click.echo(f"    Max value: {allowed.to_value}")
            if allowed.step:
                click.echo(f"    Step: {allowed.step}")
        if descriptor.additional_constraints:
            click.echo(f"    Additional constraints: {descriptor.additional_constraints}")
