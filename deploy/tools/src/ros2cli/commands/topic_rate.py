"""`ros2 topic hz` and `ros2 topic bw`."""

from __future__ import annotations

import math
import sys
from collections import deque
from typing import TYPE_CHECKING, Any

import click

from ros2cli import expression, graph
from ros2cli.options import POSITIVE_INT, direct_options

if TYPE_CHECKING:
    from rclpy.clock import Clock


@click.command
@click.argument("topic_name")
@click.option(
    "-w",
    "--window",
    type=POSITIVE_INT,
    default=10000,
    show_default=True,
    help="Number of messages for calculating the rate.",
)
@click.option(
    "--filter", "condition", metavar="EXPR", help="Python expression of m, the message: count if true."
)
@click.option("--wall-time", is_flag=True, help="Calculate the rate using wall time instead of ROS time.")
@direct_options
def hz(
    topic_name: str,
    window: int,
    condition: str | None,
    wall_time: bool,
    spin_time: float,
    use_sim_time: bool,
) -> None:
    """Print the average publishing rate to screen."""
    from rclpy.clock import Clock, ClockType
    from rclpy.qos import qos_profile_sensor_data

    wanted = expression.condition(condition)
    published = graph.is_published(topic_name)
    with graph.node(spin_time, until=published, use_sim_time=use_sim_time) as node:
        class_ = graph.message_class(node, topic_name, blocking=True)
        clock = Clock(clock_type=ClockType.SYSTEM_TIME) if wall_time else node.get_clock()
        rate = _Rate(clock, window)

        def receive(message: Any) -> None:
            if wanted(message):
                rate.count()

        node.create_subscription(class_, topic_name, receive, qos_profile_sensor_data, raw=condition is None)
        graph.spin(node)


class _Rate:
    """The intervals between messages [ns]; prints their statistics once a second."""

    def __init__(self, clock: Clock, window: int) -> None:
        self._clock = clock
        self._intervals: deque[int] = deque(maxlen=window)
        self._previous: int | None = None
        self._printed: int | None = None

    def count(self) -> None:
        now = self._clock.now().nanoseconds
        if now == 0:  # simulated time has not begun
            if self._intervals:
                click.echo("time has reset, resetting counters")
                self._intervals.clear()
            return
        if self._previous is None or now < self._previous:
            self._intervals.clear()
        else:
            self._intervals.append(now - self._previous)
        self._previous = now
        if not self._intervals:
            return
        if self._printed is None or now < self._printed:
            self._printed = now
        elif now >= self._printed + 1e9:
            self._printed = now
            self._print()

    def _print(self) -> None:
        count = len(self._intervals)
        mean = sum(self._intervals) / count
        deviation = math.sqrt(sum((interval - mean) ** 2 for interval in self._intervals) / count)
        click.echo(
            f"average rate: {1e9 / mean if mean else 0:.3f}\n"
            f"\tmin: {min(self._intervals) * 1e-9:.3f}s max: {max(self._intervals) * 1e-9:.3f}s"
            f" std dev: {deviation * 1e-9:.5f}s window: {count}"
        )


@click.command
@click.argument("topic_name", metavar="TOPIC")
@click.option(
    "-w",
    "--window",
    type=POSITIVE_INT,
    default=100,
    show_default=True,
    help="Maximum number of messages for calculating the rate.",
)
@direct_options
def bw(topic_name: str, window: int, spin_time: float, use_sim_time: bool) -> None:
    """Display bandwidth used by topic."""
    from rclpy.qos import qos_profile_sensor_data

    published = graph.is_published(topic_name)
    with graph.node(spin_time, until=published, use_sim_time=use_sim_time) as node:
        class_ = graph.message_class(node, topic_name, blocking=True)
        bandwidth = _Bandwidth(node.get_clock(), window)
        node.create_subscription(class_, topic_name, bandwidth.count, qos_profile_sensor_data, raw=True)
        click.echo(f"Subscribed to [{topic_name}]")
        node.create_timer(1.0, bandwidth.report)
        graph.spin(node)


class _Bandwidth:
    """The arrival [ns] and size [B] of the latest messages."""

    def __init__(self, clock: Clock, window: int) -> None:
        self._clock = clock
        self._messages: deque[tuple[int, int]] = deque(maxlen=window)

    def count(self, data: bytes) -> None:
        self._messages.append((self._clock.now().nanoseconds, len(data)))

    def report(self) -> None:
        if len(self._messages) < 2:
            return
        duration = self._clock.now().nanoseconds - self._messages[0][0]
        if duration <= 0:
            click.echo("WARNING: time is reset!", file=sys.stderr)
            self._messages.clear()
            return
        sizes = [size for _, size in self._messages]
        rate = sum(sizes) / (duration * 1e-9)
        # one unit for all numbers: that of the rate
        divisor, form = next(
            (10**power, form)
            for power, form in ((0, "{:.0f} B"), (3, "{:.2f} KB"), (6, "{:.2f} MB"))
            if rate < 10 ** (power + 3) or power == 6
        )
        total, mean, least, most = (
            form.format(number / divisor)
            for number in (rate, sum(sizes) / len(sizes), min(sizes), max(sizes))
        )
        click.echo(
            f"{total}/s from {len(sizes)} messages\n\tMessage size mean: {mean} min: {least} max: {most}"
        )
