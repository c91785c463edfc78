"""`ros2 topic echo`."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import TYPE_CHECKING, Any

import click

from ros2cli import expression, graph
from ros2cli.options import (
    NON_NEGATIVE_INT,
    POSITIVE_FLOAT,
    has_qos_policies,
    qos_options,
    qos_profile,
    strategy_options,
)

if TYPE_CHECKING:
    from rclpy.event_handler import QoSMessageLostInfo
    from rclpy.node import Node
    from rclpy.qos import QoSProfile


@click.command
@strategy_options
@click.argument("topic_name")
@click.argument("message_type", required=False)
@qos_options("subscribe", "sensor_data")
@click.option(
    "--csv",
    is_flag=True,
    help="Output all recursive fields separated by commas. With --include-message-info, they follow"
    " source_timestamp, received_timestamp, publication_sequence_number, reception_sequence_number.",
)
@click.option("--field", help="Echo a selected field of a message; '.' selects sub-fields.")
@click.option("-f", "--full-length", is_flag=True, help="Do not truncate arrays, bytes and strings.")
@click.option(
    "-l",
    "--truncate-length",
    type=NON_NEGATIVE_INT,
    default=128,
    show_default=True,
    help="The length to truncate arrays, bytes and strings to.",
)
@click.option("--no-arr", is_flag=True, help="Don't print array fields of messages.")
@click.option("--no-str", is_flag=True, help="Don't print string fields of messages.")
@click.option("--flow-style", is_flag=True, help="Print arrays in one line (not available with --csv).")
@click.option("--no-lost-messages", is_flag=True, help="Don't report when a message is lost.")
@click.option("--raw", is_flag=True, help="Echo the raw binary representation.")
@click.option("--filter", "condition", help="Python expression of m, the message: print if it is true.")
@click.option("--once", is_flag=True, help="Print the first message received and then exit.")
@click.option("--timeout", metavar="N", type=POSITIVE_FLOAT, help="Exit after N seconds.")
@click.option("-i", "--include-message-info", is_flag=True, help="Show the associated message info.")
def echo(
    spin_time: float,
    use_sim_time: bool,
    topic_name: str,
    message_type: str | None,
    no_lost_messages: bool,
    raw: bool,
    timeout: float | None,
    once: bool,
    **options: Any,
) -> None:
    """Output messages from a topic."""
    from rclpy.event_handler import SubscriptionEventCallbacks
    from rclpy.task import Future

    show = _printer(options)
    published = graph.is_published(topic_name)
    with graph.node(spin_time, until=published, use_sim_time=use_sim_time) as node:
        chosen = qos_profile(options) if has_qos_policies(options) else _matching(node, topic_name, options)
        if message_type is None:
            class_ = graph.message_class(node, topic_name)
            if class_ is None:
                raise click.ClickException("Could not determine the type for the passed topic")
        else:
            class_ = graph.interface_class("message", message_type, "The passed message type is invalid")
        done = Future()

        def receive(message: Any, info: dict[str, Any]) -> None:
            if not done.done() and show(message, info) and once:
                done.set_result(None)

        node.create_subscription(
            class_,
            topic_name,
            receive,
            chosen,
            event_callbacks=None
            if no_lost_messages
            else SubscriptionEventCallbacks(message_lost=_report_lost),
            raw=raw,
        )
        graph.spin(node, done, timeout)


def _matching(node: Node, topic: str, options: dict[str, Any]) -> QoSProfile:
    from rclpy.qos import DurabilityPolicy, QoSPresetProfiles, ReliabilityPolicy

    profile = copy(QoSPresetProfiles.get_from_short_key(options["qos_profile"]))
    name = graph.full_topic_name(node, topic)
    offers = [info.qos_profile for info in graph.publishers(node, name)]
    if not offers:
        return profile
    reliable = sum(offer.reliability == ReliabilityPolicy.RELIABLE for offer in offers)
    latched = sum(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers)
    profile.reliability, profile.durability = ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL
    if reliable < len(offers):
        profile.reliability = ReliabilityPolicy.BEST_EFFORT
        _warn_of_some(reliable, "QoSReliabilityPolicy.RELIABLE", "QoSReliabilityPolicy.BEST_EFFORT")
    if latched < len(offers):
        profile.durability = DurabilityPolicy.VOLATILE
        _warn_of_some(latched, "QoSDurabilityPolicy.TRANSIENT_LOCAL", "QoSDurabilityPolicy.VOLATILE")
    return profile


def _warn_of_some(count: int, offered: str, chosen: str) -> None:
    if count:
        click.echo(
            f"Some, but not all, publishers are offering {offered}. Falling back to {chosen}"
            " as it will connect to all publishers"
        )


def _report_lost(status: QoSMessageLostInfo) -> None:
    click.echo(
        f"A message was lost!!!\n\ttotal count change:{status.total_count_change}"
        f"\n\ttotal count: {status.total_count}---"
    )


def _printer(options: dict[str, Any]) -> Callable[[Any, dict[str, Any]], bool]:
    """The function that prints a message unless the filter drops it; it returns whether it printed it."""
    import yaml

    from rosidl_runtime_py import message_to_csv, message_to_yaml

    fields = [field for field in (options["field"] or "").split(".") if field]
    if options["field"] is not None and not fields:
        raise click.ClickException(f"Invalid field value '{options['field']}'")
    wanted = expression.condition(options["condition"])
    with_info = options["include_message_info"]
    shape = {
        "truncate_length": None if options["full_length"] else options["truncate_length"],
        "no_arr": options["no_arr"],
        "no_str": options["no_str"],
    }

    def show(message: Any, info: dict[str, Any]) -> bool:
        for field in fields:
            try:
                message = getattr(message, field)
            except AttributeError as error:
                raise click.ClickException(f"Invalid field '{'.'.join(fields)}': {error}") from None
        if not wanted(message):
            return False
        if not hasattr(message, "SLOT_TYPES"):  # a field that is no message, or raw data
            if with_info:
                click.echo(f"---Got new message, message info:---\n{info}\n---Message data:---")
            click.echo(f"{message}\n---")
        elif options["csv"]:
            values = message_to_csv(message, **shape)
            click.echo(",".join([*map(str, info.values() if with_info else []), values]))
        else:
            if with_info:
                click.echo(f"{yaml.dump(info)}---")
            click.echo(f"{message_to_yaml(message, **shape, flow_style=options['flow_style'])}---")
        return True

    return show
