"""`ros2 topic pub`."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import click

from ros2cli import graph
from ros2cli.options import (
    NON_NEGATIVE_INT,
    POSITIVE_FLOAT,
    direct_options,
    fill,
    parsed_yaml,
    qos_options,
    qos_profile,
    values_argument,
)

if TYPE_CHECKING:
    from rclpy.publisher import Publisher

_PERIOD = 0.02
"""Period at which matching subscriptions are counted [s]."""


@click.command
@click.argument("topic_name")
@click.argument("message_type")
@values_argument("values", "Read values from standard input.")
@click.option(
    "-r", "--rate", metavar="N", type=POSITIVE_FLOAT, default=1.0, show_default=True, help="Rate in Hz."
)
@click.option(
    "-p",
    "--print",
    "print_nth",
    metavar="N",
    type=int,
    default=1,
    show_default=True,
    help="Only print every N-th published message.",
)
@click.option("-1", "--once", is_flag=True, help="Publish one message and exit.")
@click.option(
    "-t", "--times", type=NON_NEGATIVE_INT, default=0, help="Publish this number of times and then exit."
)
@click.option(
    "-w",
    "--wait-matching-subscriptions",
    type=NON_NEGATIVE_INT,
    help="Wait for this number of matching subscriptions; by default 1 with --once or --times, otherwise 0.",
)
@click.option(
    "--max-wait-time-secs", type=POSITIVE_FLOAT, help="The longest wait for matching subscriptions."
)
@click.option(
    "--keep-alive",
    metavar="N",
    type=POSITIVE_FLOAT,
    default=0.1,
    show_default=True,
    help="Keep the node alive for N seconds after the last message.",
)
@click.option("-n", "--node-name", help="Name of the publishing node.")
@qos_options("publish", "default")
@direct_options
def pub(
    topic_name: str,
    message_type: str,
    values: str,
    rate: float,
    print_nth: int,
    once: bool,
    times: int,
    wait_matching_subscriptions: int | None,
    max_wait_time_secs: float | None,
    keep_alive: float,
    node_name: str | None,
    spin_time: float,
    use_sim_time: bool,
    **qos: Any,
) -> None:
    """Publish a message to a topic.

    VALUES fill the message, in YAML ("data: Hello World"); other fields keep their defaults. A Header may be
    auto and a Time may be now: they become the time of publishing.
    """
    from rclpy.task import Future

    if once and times:
        raise click.UsageError("argument -t/--times: not allowed with argument -1/--once")
    times = 1 if once else times
    class_ = graph.interface_class("message", message_type, "The passed message type is invalid")
    if not isinstance(parsed_yaml(values), dict):
        raise click.ClickException("The passed value needs to be a dictionary in YAML format")
    wanted = wait_matching_subscriptions
    wanted = int(times > 0) if wanted is None else wanted
    if wanted == 0 and max_wait_time_secs is not None:
        raise click.ClickException(
            "--max-wait-time-secs option is only effective"
            " with --wait-matching-subscriptions, --once or --times"
        )
    message = class_()
    stamps = fill(message, values, expand_header_auto=True, expand_time_now=True)

    # Matching subscriptions are awaited below, without a fixed time.
    with graph.node(0.0 if wanted else spin_time, name=node_name, use_sim_time=use_sim_time) as node:
        publisher = node.create_publisher(class_, topic_name, qos_profile(qos))
        _await_subscriptions(publisher, wanted, max_wait_time_secs)
        click.echo("publisher: beginning loop")
        done = Future()
        count = 0

        def publish() -> None:
            nonlocal count
            now = node.get_clock().now().to_msg()
            for set_stamp in stamps:
                set_stamp(now)
            count += 1
            if print_nth and count % print_nth == 0:
                click.echo(f"publishing #{count}: {message!r}\n")
            publisher.publish(message)
            if count == times:
                done.set_result(None)

        publish()
        if times != 1:
            node.create_timer(1.0 / rate, publish)
            graph.spin(node, done)
        time.sleep(keep_alive)


def _await_subscriptions(publisher: Publisher, wanted: int, longest: float | None) -> None:
    """Wait for matching subscriptions, at most `longest` [s], and say so every second."""
    began, said = time.monotonic(), -math.inf
    while (count := publisher.get_subscription_count()) < wanted:
        now = time.monotonic()
        if now >= said + 1.0:
            click.echo(f"Waiting for at least {wanted} matching subscription(s)...")
            said = now
        if longest is not None and now >= began + longest:
            raise click.ClickException(
                f"Timed out waiting for subscribers: Expected {wanted} subcribers"
                f" but only got {count} subscribers"
            )
        time.sleep(_PERIOD)
