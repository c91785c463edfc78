"""Options and types of arguments that several verbs share."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ros2cli.graph import default_spin_time

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

_Verb = TypeVar("_Verb", bound=Callable[..., Any])


class FiniteFloat(click.FloatRange):
    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number; fail with one line."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value!r} is not finite.", param, ctx)
        return number


# The limit of times in seconds and of rates, 31 years, fits every clock.
FINITE_FLOAT = FiniteFloat(max=1e9)
POSITIVE_FLOAT = FiniteFloat(min=1e-9, max=1e9)
POSITIVE_INT = click.IntRange(min=1)
NON_NEGATIVE_INT = click.IntRange(min=0)


def direct_options(verb: _Verb) -> _Verb:
    verb = click.option(
        "--spin-time",
        type=FINITE_FLOAT,
        callback=lambda context, parameter, value: default_spin_time() if value is None else value,
        show_default="0.5, or 3.2 with Fast DDS or security",
        help="Time in seconds to look for nodes. It looks longer while it still finds more.",
    )(verb)
    return click.option("-s", "--use-sim-time", is_flag=True, help="Enable ROS simulation time.")(verb)


def strategy_options(verb: _Verb) -> _Verb:
    """Add the options of `direct_options` and ``--no-daemon``."""
    verb = direct_options(verb)
    return click.option(
        "--no-daemon", is_flag=True, expose_value=False, help="No effect: this command line has no daemon."
    )(verb)


def node_options(verb: _Verb) -> _Verb:
    """Add the options of `strategy_options` and those of verbs that wait for a node."""
    verb = strategy_options(verb)
    verb = click.option("--include-hidden-nodes", is_flag=True, help="Consider hidden nodes as well.")(verb)
    return click.option(
        "--timeout",
        metavar="N",
        type=int,
        default=1,
        show_default=True,
        help="Wait for N seconds until the node becomes available.",
    )(verb)


def qos_options(action: str, default: str) -> Callable[[_Verb], _Verb]:
    def decorate(verb: _Verb) -> _Verb:
        from rclpy import qos

        for option, keys in (
            ("liveliness", qos.LivelinessPolicy.short_keys()),
            ("durability", qos.DurabilityPolicy.short_keys()),
            ("reliability", qos.ReliabilityPolicy.short_keys()),
            ("history", qos.HistoryPolicy.short_keys()),
        ):
            verb = click.option(
                f"--qos-{option}",
                type=click.Choice(keys),
                help=f"Quality of service {option} to {action} with (overrides that of --qos-profile).",
            )(verb)
        verb = click.option(
            "--qos-liveliness-lease-duration-seconds",
            type=FINITE_FLOAT,
            help=f"Quality of service liveliness lease duration to {action} with.",
        )(verb)
        verb = click.option("--qos-depth", metavar="N", type=int, help=f"Queue size to {action} with.")(verb)
        return click.option(
            "--qos-profile",
            type=click.Choice(qos.QoSPresetProfiles.short_keys()),
            default=default,
            show_default=True,
            help=f"Quality of service preset profile to {action} with.",
        )(verb)

    return decorate


def qos_profile(options: dict[str, Any]) -> QoSProfile:
    """Return the preset that the options of `qos_options` name, with the policies that they override."""
    from copy import copy

    from rclpy import qos
    from rclpy.duration import Duration

    profile = copy(qos.QoSPresetProfiles.get_from_short_key(options["qos_profile"]))
    for policy, keys in (
        ("history", qos.HistoryPolicy),
        ("durability", qos.DurabilityPolicy),
        ("reliability", qos.ReliabilityPolicy),
        ("liveliness", qos.LivelinessPolicy),
    ):
        if key := options[f"qos_{policy}"]:
            setattr(profile, policy, keys.get_from_short_key(key))
    lease = options["qos_liveliness_lease_duration_seconds"]
    if lease is not None and lease > 0:
        profile.liveliness_lease_duration = Duration(seconds=lease)
    depth = options["qos_depth"]
    if depth is not None and depth > 0:
        profile.depth = depth
    elif profile.durability == qos.DurabilityPolicy.TRANSIENT_LOCAL and profile.depth == 0:
        profile.depth = 1
    return profile


def has_qos_policies(options: dict[str, Any]) -> bool:
    """Whether an option of `qos_options` overrides a policy of the preset."""
    return any(
        options[name] is not None for name in options if name.startswith("qos_") and name != "qos_profile"
    )


class ManyValues(click.Option):
    """An option with one or more values, as ``--topics /a /b``."""

    def __init__(self, param_decls: Sequence[str] | None = None, **attributes: Any) -> None:
        super().__init__(param_decls, **attributes | {"multiple": True})


class VerbWithManyValues(click.Command):
    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeat such an option before each of its values, as click expects it."""
        many = {name for param in self.params if isinstance(param, ManyValues) for name in param.opts}
        repeated: list[str] = []
        option = ""
        for index, argument in enumerate(args):
            if argument in many:
                option = argument
                if index + 1 == len(args) or args[index + 1].startswith("-"):
                    raise click.BadOptionUsage(option, f"Option '{option}' requires an argument.", ctx)
            elif argument.startswith("-"):
                option = ""
                repeated.append(argument)
            else:
                repeated += [option, argument] if option else [argument]
        return super().parse_args(ctx, repeated)


def values_argument(name: str, help: str) -> Callable[[_Verb], _Verb]:
    """Add an argument with YAML values, by default ``{}``, and the option ``--stdin`` that replaces it."""

    def read(context: click.Context, parameter: click.Parameter, value: str | None) -> str:
        if context.params.pop("stdin"):
            if value is not None:
                raise click.UsageError(f"argument {name}: not allowed with argument --stdin", context)
            return sys.stdin.read()
        return "{}" if value is None else value

    def decorate(verb: _Verb) -> _Verb:
        verb = click.argument(name, required=False, callback=read, metavar=f"[{name.upper()}]")(verb)
        return click.option("--stdin", is_flag=True, is_eager=True, help=help)(verb)

    return decorate


def parsed_yaml(text: str) -> Any:
    """Parse YAML, except for scalars without quotes: their types are those of the fields.

    :raises ClickException: if the text is malformed.
    """
    import ros_yaml

    try:
        return ros_yaml.load_plain(text)
    except ros_yaml.YamlError as error:
        raise click.ClickException(f"The value is no valid YAML: {error}") from None


def fill(message: Any, values: str, **options: Any) -> list[Callable[[Any], None]]:
    """Set a message from YAML as `set_message_fields` does. Raises ClickException if a value does not fit."""
    from rosidl_runtime_py import set_message_fields

    try:
        later = set_message_fields(message, parsed_yaml(values), **options)
        check(message)
    except Exception as error:
        raise click.ClickException(f"Failed to populate field: {error}") from None
    return later


def check(message: Any) -> None:
    """Raise an exception if a field has a value that it cannot hold; ROS 2 notices it when it serializes."""
    from rclpy.serialization import serialize_message

    try:
        serialize_message(message)
    except SystemError as error:
        raise ValueError(error.__cause__) from None  # the error of the C code
