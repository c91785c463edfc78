"""Ctrl-C and SIGTERM end whoever spins, at once and without a trace."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

SPIN = """
import rclpy
from rclpy.executors import ExternalShutdownException
rclpy.init(args=[])
node = rclpy.create_node("spinner")
timer = node.create_timer(0.0, lambda: (timer.cancel(), print("spinning", flush=True)))
try:
    rclpy.spin(node)
except (KeyboardInterrupt, ExternalShutdownException):
    pass  # or spin() returns, if the signal came while a callback ran
print(rclpy.ok())
node.destroy_node()
rclpy.try_shutdown()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_spinning_and_shuts_the_context_down(number: signal.Signals, domain_id: int) -> None:
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain_id)}
    with subprocess.Popen(
        [sys.executable, "-c", SPIN],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline() == "spinning\n"
        process.send_signal(number)
        assert process.wait(10) == 0
        assert process.stdout.read() == "False\n"
        assert process.stderr.read() == ""
