"""`ros2 topic list` and `ros2 topic info`."""

from __future__ import annotations

import click

from ros2cli import graph
from ros2cli.options import strategy_options


@click.command("list")
@strategy_options
@click.option("-t", "--show-types", is_flag=True, help="Additionally show the topic type.")
@click.option("-c", "--count-topics", is_flag=True, help="Only display the number of topics discovered.")
@click.option("--include-hidden-topics", is_flag=True, help="Consider hidden topics as well.")
@click.option("-v", "--verbose", is_flag=True, help="List full details about each topic.")
@click.pass_context
def list_topics(
    context: click.Context,
    spin_time: float,
    use_sim_time: bool,
    show_types: bool,
    count_topics: bool,
    include_hidden_topics: bool,
    verbose: bool,
) -> None:
    """Output a list of available topics."""
    hidden = include_hidden_topics or (context.parent and context.parent.params["include_hidden_topics"])
    with graph.node(spin_time, use_sim_time=use_sim_time) as node:
        topics = [
            (name, ", ".join(types), node.count_publishers(name), node.count_subscribers(name))
            for name, types in graph.topics(node, include_hidden=bool(hidden))
        ]
    if count_topics:
        click.echo(len(topics))
    elif topics and verbose:
        published = [(name, types, count) for name, types, count, _ in topics]
        subscribed = [(name, types, count) for name, types, _, count in topics]
        click.echo(_table("Published topics:", published, "publisher"))
        click.echo(_table("Subscribed topics:", subscribed, "subscriber"))
    else:
        for name, types, _, _ in topics:
            click.echo(f"{name} [{types}]" if show_types else name)


def _table(title: str, topics: list[tuple[str, str, int]], noun: str) -> str:
    rows = [
        f" * {name} [{types}] {count} {noun}{'s' if count > 1 else ''}\n"
        for name, types, count in topics
        if count
    ]
    return "".join([f"{title}\n", *rows])


@click.command
@strategy_options
@click.argument("topic_name")
@click.option(
    "-v",
    "--verbose",
    is_flag=True,
    help="Print the name, namespace, type, type hash, GID and QoS of each publisher and subscription.",
)
def info(spin_time: float, use_sim_time: bool, topic_name: str, verbose: bool) -> None:
    """Print information about a topic."""
    with graph.node(spin_time, use_sim_time=use_sim_time) as node:
        types = dict(node.get_topic_names_and_types()).get(topic_name)
        if types is None:
            raise click.ClickException(f"Unknown topic '{topic_name}'")
        publishers = node.get_publishers_info_by_topic(topic_name)
        subscriptions = node.get_subscriptions_info_by_topic(topic_name)
    lines = [f"Type: {types[0] if len(types) == 1 else types}", f"Publisher count: {len(publishers)}"]
    lines += map(str, publishers if verbose else [])
    lines += [f"Subscription count: {len(subscriptions)}"]
    lines += map(str, subscriptions if verbose else [])
    for line in lines:
        click.echo(f"{line}\n" if verbose else line)
