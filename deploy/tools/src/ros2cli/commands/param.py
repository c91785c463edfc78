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
    from rclpy.parameter import Parameter

    import ros_yaml

    with parameters.client(node_name, **options) as client:
        described = parameters.response(client, client.describe_parameters([parameter_name])).descriptors
        is_text = [each.type for each in described] == [Parameter.Type.STRING.value]
        try:
            plain = ros_yaml.load_plain(value)
            is_value = plain is not None and (type(plain) is str or not is_text)
            given = ros_yaml.typed(plain) if is_value else value  # a text needs no quotes
            parameter = Parameter(parameter_name, value=given).to_parameter_msg()
            check(parameter)
        except Exception as error:
            raise click.ClickException(f"'{value}' cannot be the value of a parameter: {error}") from None
        (result,) = parameters.response(client, client.set_parameters([parameter])).results
    outcome = "Set parameter successful" if result.successful else "Setting parameter failed"
    click.echo(f"{outcome}: {result.reason}" if result.reason else outcome, err=not result.successful)


@click.command
@node_options
@click.argument("node_name")
def dump(node_name: str, **options: Any) -> None:
    """Show all of the parameters of a node in a YAML file format."""
    from rclpy.parameter import parameter_value_to_python

    import ros_yaml

    with parameters.client(node_name, **options) as client:
        names = sorted(parameters.response(client, client.list_parameters()).result.names)
        # One by one: for a parameter that was declared without a value, a node answers nothing at all.
        found = {name: parameters.response(client, client.get_parameters([name])).values for name in names}
    tree: dict[str, Any] = {}
    for name, values in found.items():
        value = parameter_value_to_python(values[0]) if values else None
        if value in (None, []) or (isinstance(value, list) and isinstance(value[0], bytes)):
            click.echo(f"# {name}: no parameter file can hold its value")
        else:
            _place(tree, name, value)
    document = {parameters.full_name(node_name): {"ros__parameters": tree}}
    click.echo(ros_yaml.dump(document))


def _place(tree: dict[str, Any], name: str, value: Any) -> None:
    """Put a parameter into a tree, below its prefix unless that is a parameter or no word."""
    branch, _, leaf = name.partition(".")
    below = tree.setdefault(branch, {}) if branch and leaf and not leaf.startswith(".") else None
    if isinstance(below, dict):
        _place(below, leaf, value)
    else:
        tree[name] = value


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
