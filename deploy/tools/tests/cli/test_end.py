"""How commands end: by signals, by a closed pipe, by wrong arguments. And what they cost at the start."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from typing import Any

import pytest
import rclpy
from rclpy import executors

from ros2cli import graph


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 2), (signal.SIGTERM, 15)])
@pytest.mark.parametrize(
    "arguments",
    [
        ["topic", "echo", "/arm/chatter"],
        ["topic", "echo", "/arm/point"],  # nothing comes after the first message
        ["topic", "hz", "/arm/chatter"],
        ["topic", "bw", "/arm/chatter"],
        ["topic", "pub", "/arm/x", "std_msgs/msg/String"],
        ["topic", "pub", "--once", "/arm/x", "std_msgs/msg/String"],
        ["topic", "hz", "/nothing"],
        ["service", "call", "/nothing", "std_srvs/srv/Trigger"],
    ],
)
@pytest.mark.own  # in ROS 2, some of these print a traceback
def test_signal_ends_a_command_without_a_traceback(
    lab: Any, start: Any, arguments: list[str], number: signal.Signals, code: int
) -> None:
    process = start(*arguments)
    process.stdout.readline()
    process.send_signal(number)
    _, err = process.communicate(timeout=30)
    assert (err, process.returncode) == ("", code)


@pytest.mark.own
def test_spinning_ends_a_thread_that_is_about_to_wait(
    domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    begins = threading.Event()
    count = executors.NumberOfEntities

    def count_late(*arguments: int) -> Any:
        begins.set()
        time.sleep(0.2)  # the scope ends meanwhile; if a busy machine is later still, the test shows nothing
        return count(*arguments)

    monkeypatch.setattr(executors, "NumberOfEntities", count_late)  # between rclpy's look and its wait
    rclpy.init(args=[], domain_id=domain_id)
    node = rclpy.create_node("x")
    with graph.spinning(node):
        assert begins.wait(10)
    node.destroy_node()
    rclpy.shutdown()


INTERRUPTED = """
import builtins, os, signal, sys
from ros2cli.cli import main

def interrupt(name, *rest):
    if name == "{module}":
        os.kill(os.getpid(), signal.SIGINT)
    return importing(name, *rest)

importing, builtins.__import__ = builtins.__import__, interrupt
sys.argv = ["ros2", "node", "list"]
sys.exit(main())
"""


@pytest.mark.own
@pytest.mark.parametrize("module", ["click", "ros2cli.commands", "rclpy"])
def test_ctrl_c_during_start_up_shows_no_traceback(module: str) -> None:
    command = [sys.executable, "-c", INTERRUPTED.format(module=module)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30)
    assert (done.stdout, done.stderr, done.returncode) == ("", "", 2)


@pytest.mark.own
def test_closed_pipe_ends_a_command(lab: Any, start: Any) -> None:
    process = start("topic", "echo", "/arm/chatter")
    assert process.stdout.readline() == "data: hello\n"
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait(30) == 1


@pytest.mark.parametrize(
    "arguments",
    [["nothing"], ["topic", "nothing"], ["topic", "list", "--nothing"], ["topic", "echo"]],
)
def test_wrong_arguments_end_with_2(ros2: Any, arguments: list[str]) -> None:
    done = ros2(*arguments)
    assert done.stdout == ""
    assert done.stderr
    assert done.returncode == 2


@pytest.mark.parametrize("arguments", [[], ["topic"], ["topic", "echo", "-h"], ["--help"]])
def test_help_ends_with_0(ros2: Any, arguments: list[str]) -> None:
    done = ros2(*arguments)
    assert done.stdout.lower().startswith("usage: ros2")
    assert done.returncode == 0


@pytest.mark.own
def test_help_imports_only_what_it_needs() -> None:
    program = "import sys; from ros2cli.commands import ros2, topic; print(*sys.modules)"
    modules = subprocess.check_output([sys.executable, "-c", program], text=True, timeout=30).split()
    assert not {"rclpy", "numpy", "yaml"} & {*modules}
