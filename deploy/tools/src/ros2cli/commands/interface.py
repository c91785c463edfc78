"""`ros2 interface show` and `ros2 interface list`."""

from __future__ import annotations

import re
import sys

import click

from mcap_files.definition import message_type


@click.command("list")
@click.option("-m", "--only-msgs", is_flag=True, help="Print out only the message types.")
@click.option("-s", "--only-srvs", is_flag=True, help="Print out only the service types.")
@click.option("-a", "--only-actions", is_flag=True, help="Print out only the action types.")
def list_interfaces(only_msgs: bool, only_srvs: bool, only_actions: bool) -> None:
    """List all interface types available."""
    import rosidl_runtime_py

    everything = not (only_msgs or only_srvs or only_actions)
    for title, wanted, interfaces in (
        ("Messages:", only_msgs, rosidl_runtime_py.get_message_interfaces),
        ("Services:", only_srvs, rosidl_runtime_py.get_service_interfaces),
        ("Actions:", only_actions, rosidl_runtime_py.get_action_interfaces),
    ):
        if wanted or everything:
            click.echo(title)
            for package, names in sorted(interfaces().items()):
                for name in sorted(names):
                    click.echo(f"    {package}/{name}")


@click.command
@click.argument("type_", metavar="TYPE")
@click.option("--all-comments", is_flag=True, help="Show the comments of nested interfaces as well.")
@click.option("--no-comments", is_flag=True, help="Show no comments or whitespace.")
def show(type_: str, all_comments: bool, no_comments: bool) -> None:
    """Output the interface definition of TYPE (e.g. 'std_msgs/msg/String'); '-' reads the type from stdin."""
    if all_comments and no_comments:
        raise click.UsageError("argument --no-comments: not allowed with argument --all-comments")
    if type_ == "-":
        if sys.stdin.isatty():
            raise click.UsageError("expected stdin pipe")
        type_ = sys.stdin.readline().strip()
    if not type_:
        raise click.UsageError("the passed value is empty")
    try:
        _show(type_, comments=not no_comments, nested_comments=all_comments)
    except (ValueError, LookupError) as error:
        raise click.ClickException(str(error)) from None


def _show(name: str, *, comments: bool, nested_comments: bool, indent: str = "") -> None:
    """Print a definition; below each field of a message type, that definition, indented further."""
    from rosidl_runtime_py import get_interface_path

    if len(name.split("/")) != 3:
        raise ValueError(f"Invalid name '{name}'. Expected three parts separated by '/'")
    package = name.partition("/")[0]
    with open(get_interface_path(name), encoding="utf-8") as file:
        lines = file.read().splitlines()
    for line in map(str.rstrip, lines):
        text = line if comments else _without_comment(line)
        if text:
            click.echo(f"{indent}{text}")
        elif comments:
            click.echo()
        if nested := message_type(line, package):
            _show(nested, comments=nested_comments, nested_comments=nested_comments, indent=f"{indent}\t")


def _without_comment(line: str) -> str:
    """The line without its comment; a '#' within quotes begins none."""
    match = re.match(r"""(?:[^#"']|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*'|["'])*""", line)
    return match.group().strip() if match else line
