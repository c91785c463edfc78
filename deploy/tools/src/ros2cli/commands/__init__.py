"""The commands and their verbs; a verb's module is imported when it is used."""

from __future__ import annotations

import importlib

import click

_HELP_OPTIONS = {"help_option_names": ["-h", "--help"]}


class Command(click.Group):
    """A command whose verbs are looked up as ``module:function`` below this package."""

    def __init__(
        self, name: str, help: str, verbs: dict[str, str], params: list[click.Parameter] | None = None
    ) -> None:
        super().__init__(
            name,
            help=help,
            params=params,
            callback=_print_help,
            invoke_without_command=True,
            context_settings=_HELP_OPTIONS,
            subcommand_metavar="VERB [ARGS]...",
        )
        self._verbs = verbs

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(self._verbs)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in self._verbs:
            return None
        module, _, function = self._verbs[name].partition(":")
        verb: click.Command = getattr(importlib.import_module(f"{__name__}.{module}"), function)
        return verb


@click.pass_context
def _print_help(context: click.Context, /, **_: object) -> None:
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@click.group(
    context_settings=_HELP_OPTIONS, invoke_without_command=True, subcommand_metavar="COMMAND VERB [ARGS]..."
)
@click.pass_context
def ros2(context: click.Context) -> None:
    """Look at ROS 2 nodes and talk to them. This is the command line of a machine without ROS 2."""
    _print_help()


_COMMANDS = [
    Command(
        "action",
        "Various action related sub-commands",
        {"info": "action:info", "list": "action:list_actions", "send_goal": "action_send_goal:send_goal"},
    ),
    Command(
        "interface",
        "Show information about ROS interfaces",
        {"list": "interface:list_interfaces", "show": "interface:show"},
    ),
    Command("node", "Various node related sub-commands", {"info": "node:info", "list": "node:list_nodes"}),
    Command(
        "param",
        "Various param related sub-commands",
        {
            "describe": "param:describe",
            "dump": "param:dump",
            "get": "param:get",
            "list": "param_list:list_parameters",
            "set": "param:set_parameter",
        },
    ),
    Command(
        "service",
        "Various service related sub-commands",
        {"call": "service:call", "list": "service:list_services", "type": "service:show_type"},
        [click.Option(["--include-hidden-services"], is_flag=True, help="Consider hidden services as well.")],
    ),
    Command(
        "topic",
        "Various topic related sub-commands",
        {
            "bw": "topic_rate:bw",
            "echo": "topic_echo:echo",
            "hz": "topic_rate:hz",
            "info": "topic:info",
            "list": "topic:list_topics",
            "pub": "topic_pub:pub",
        },
        [click.Option(["--include-hidden-topics"], is_flag=True, help="Consider hidden topics as well.")],
    ),
]
for _command in _COMMANDS:
    ros2.add_command(_command)
