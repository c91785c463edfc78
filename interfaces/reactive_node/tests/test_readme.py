from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import rclpy
from rclpy.action import ActionServer
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Bool, Float64, Int64, String
from std_srvs.srv import SetBool

from interfaces.reactive_node.tests.fibonacci import Fibonacci
from reactive_node.testing import MakeNode, SpinUntil

PROJECT = Path(__file__).parents[1]


def blocks(page: str) -> list[str]:
    """Return the programs that a page shows."""
    text = (PROJECT / page).read_text(encoding="utf-8")
    text = text.replace("example_interfaces", Fibonacci.__module__.partition(".")[0])
    return re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


BLOCKS = blocks("README.md")
NAME = re.compile(r"# (\w+\.py)\n")
"""The first line of a block that is a file, or a part of an example."""
EXAMPLES = {path.name: path.read_text() for path in PROJECT.glob("examples/*.py")}


@pytest.fixture
def files(tmp_path: Path) -> Path:
    shown = {name[1]: block for block in [*BLOCKS, *blocks("SIGNALS.md")] if (name := NAME.match(block))}
    for name, text in (shown | EXAMPLES).items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.fixture
def listings(domain_id: int) -> Iterator[dict[str, Any]]:
    names: dict[str, Any] = {}
    try:
        for block in BLOCKS:
            if not NAME.match(block):
                exec(block, names)
        yield names
    finally:
        for node in [value for value in names.values() if isinstance(value, Node)]:
            node.destroy_node()
        rclpy.try_shutdown()


def test_listings_print_data_and_completion(
    listings: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    talker = listings["talker"] = Node("talker")
    publisher = talker.create_publisher(String, "topic", 10)
    printed: set[str] = set()
    deadline = time.monotonic() + 10.0

    with SingleThreadedExecutor() as executor:
        for node in (talker, listings["node"], listings["reactive"]):
            executor.add_node(node)
        while len(printed) < 2 and time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.1)
            if publisher.get_subscription_count() == 2:
                publisher.publish(String(data="hello"))
            printed.update(capsys.readouterr().out.splitlines())
        listings["reactive"].destroy_node()

    assert printed == {"Data: hello", "Reactive data: hello"}
    assert capsys.readouterr().out == "Completed\n"


def test_listings_use_action_service_and_latest(
    listings: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    peer = listings["peer"] = Node("peer")

    def execute(goal: Any) -> Any:
        goal.succeed()
        return Fibonacci.Result(sequence=[0, 1, 1, 2])

    server = ActionServer(peer, Fibonacci, "fibonacci", execute)
    client = peer.create_client(SetBool, "switch")
    publisher = peer.create_publisher(String, "topic", 10)
    counts: list[int] = []
    peer.create_subscription(Int64, "count", lambda message: counts.append(message.data), 10)
    response = None
    printed = ""
    deadline = time.monotonic() + 10.0

    with SingleThreadedExecutor() as executor:
        executor.add_node(peer)
        executor.add_node(listings["reactive"])
        while time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.1)
            publisher.publish(String(data="hello"))
            if response is None and client.service_is_ready():
                response = client.call_async(SetBool.Request(data=True))
            printed += capsys.readouterr().out
            if counts and "Sequence" in printed and response is not None and response.done():
                break
    server.destroy()

    assert "Sequence: [0, 1, 1, 2]" in printed
    assert response is not None
    assert response.result().success is True
    assert counts[0] == len("hello")


@pytest.mark.parametrize("name", EXAMPLES)
def test_shown_part_is_in_the_example(name: str) -> None:
    assert [block for block in BLOCKS if block.removeprefix(f"# {name}\n") in EXAMPLES[name]]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_program_publishes_alarm_until_signal(
    files: Path, make_node: MakeNode, spin_until: SpinUntil, number: signal.Signals
) -> None:
    peer = make_node("peer", kind=Node)
    voltage = peer.create_publisher(Float64, "voltage", 10)
    alarms: list[bool] = []
    peer.create_subscription(Bool, "battery_low", lambda message: alarms.append(message.data), 10)
    program = subprocess.Popen(
        [sys.executable, files / "battery_alarm.py"], stderr=subprocess.PIPE, text=True
    )
    try:
        spin_until(lambda: voltage.get_subscription_count() == 1)
        voltage.publish(Float64(data=10.5))
        spin_until(lambda: alarms == [True])

        program.send_signal(number)
        # ROS 2's rclpy wakes the executor before it ends the context. The executor may then wait again.
        with suppress(subprocess.TimeoutExpired):
            program.wait(timeout=3)
        program.send_signal(number)
        _, errors = program.communicate(timeout=10)
    finally:
        program.kill()
        program.wait()

    assert (program.returncode, errors) == (0, "")


def test_tests_of_both_pages_pass(files: Path) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--rootdir={files}", files]
    environment = os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}

    run = subprocess.run(command, cwd=files, env=environment, capture_output=True, text=True)

    assert run.returncode == 0, run.stdout
    assert run.stdout.splitlines()[-1].startswith("6 passed")
