"""Measures the costs of rclpy: ``make bench`` or ``python run.py [OPTION ...] [NAME=COMMAND ...]``.

Each COMMAND starts a Python with an rclpy, such as ``embedded=.venv/bin/python`` or a script that sources
ROS 2 and ends with ``exec python "$@"``. The default is this interpreter. ``nodes.c`` shows what the
middleware itself costs. Every round measures all of them, so a busy machine affects all alike. The table
shows the medians of the rounds. With ``--awake`` no processor sleeps during a measurement, see :mod:`awake`.
CPU time is that of the whole process, with all its threads.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import shutil
import statistics
import subprocess
import sys
from collections import defaultdict
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from awake import processors_awake
from reactive_node.domains import reserved_domain

NODES = Path(__file__).with_name("nodes.py")
TIMEOUT = 120.0  # [s]

# The processes of each measurement, in the order of their start.
MEASUREMENTS = (("echo", "ping"), ("flood", "sink"), ("publish",), ("timer",), ("idle",), ("start",))

FIGURES = {
    "ping.p50": ("echo round trip, p50", "µs"),
    "ping.p99": ("echo round trip, p99", "µs"),
    "sink.messages_per_second": ("flooded subscriber", "msg/s"),
    "sink.cpu_us": ("flooded subscriber, CPU", "µs/msg"),
    "flood.messages_per_second": ("publisher that floods it", "msg/s"),
    "publish.messages_per_second": ("publisher without subscribers", "msg/s"),
    "publish.cpu_us": ("publisher without subscribers, CPU", "µs/msg"),
    "timer.cpu_percent": ("100 Hz timer, CPU", "% of a core"),
    "idle.cpu_percent": ("idle node, CPU", "% of a core"),
    "start.seconds": ("import, init, node", "s"),
    "start.megabytes": ("memory of a node", "MB"),
    "start.threads": ("threads of a node", ""),
}


def measure(command: list[str], roles: tuple[str, ...], domain_id: int) -> dict[str, float]:
    """Run the processes of one measurement and return the figures that they report."""
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain_id),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }
    processes = [
        subprocess.Popen([*command, str(NODES), role], env=environment, stdout=subprocess.PIPE, text=True)
        for role in roles
    ]
    try:
        outputs = [process.communicate(timeout=TIMEOUT)[0] for process in reversed(processes)]
    finally:
        for process in processes:
            process.kill()
            process.wait()
    return {
        f"{role}.{name}": value
        for role, output in zip(reversed(roles), outputs, strict=True)
        for name, value in json.loads(output or "{}").items()
    }


def table(results: dict[str, dict[str, list[float]]]) -> str:
    """Return a Markdown table of medians: a row for each figure, a column for each rclpy."""
    lines = [f"| | | {' | '.join(results)} |", f"|---|---|{'---:|' * len(results)}"]
    for key, (name, unit) in FIGURES.items():
        values = " | ".join(_median(figures.get(key, ())) for figures in results.values())
        lines.append(f"| {name} | {unit} | {values} |")
    return "\n".join(lines)


def _median(values: Sequence[float]) -> str:
    if not values:
        return "–"
    median = statistics.median(values)
    return f"{median:,.{0 if median >= 100 else 2}f}"


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure the costs of rclpy.")
    parser.add_argument("--rounds", type=int, default=3, help="how many times to measure (3)")
    parser.add_argument("--awake", action="store_true", help="keep the processors from sleeping")
    parser.add_argument(
        "commands", nargs="*", metavar="NAME=COMMAND", help="a command that starts a Python with an rclpy"
    )
    arguments = parser.parse_args()
    for word in arguments.commands:
        name, _, command = word.partition("=")
        if not name or not command or shutil.which(shlex.split(command)[0]) is None:
            parser.error(f"{word} is not NAME=COMMAND with an existing command")
    commands = dict(command.split("=", 1) for command in arguments.commands) or {"rclpy": sys.executable}
    results: dict[str, dict[str, list[float]]] = {name: defaultdict(list) for name in commands}
    with processors_awake() if arguments.awake else nullcontext():
        for _ in range(arguments.rounds):
            for roles in MEASUREMENTS:
                for name, command in commands.items():
                    with reserved_domain() as domain_id:
                        for figure, value in measure(shlex.split(command), roles, domain_id).items():
                            results[name][figure].append(value)
    print(table(results))


if __name__ == "__main__":
    main()
