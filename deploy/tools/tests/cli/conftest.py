"""A graph, and commands that run as processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from deploy.ground.tests.nodes import spinning
from geometry_msgs.msg import PointStamped
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from std_msgs.msg import Float64, Header, String
from std_srvs.srv import SetBool

PROGRAM = "import sys; sys.argv[0] = 'ros2'; from ros2cli.cli import main; sys.exit(main())"
TIMEOUT = 60.0


class Lab(Node):
    def __init__(self, context: Context) -> None:
        super().__init__("lab", namespace="/arm", context=context)
        described = ParameterDescriptor(
            description="length of a link [m]",
            floating_point_range=[FloatingPointRange(from_value=0.0, to_value=10.0)],
        )
        self.declare_parameter("length", 2.0, described)
        self.declare_parameter("names", ["a", "b"])
        self.declare_parameter("limits.speed", 3)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_publisher(PointStamped, "point", latched).publish(
            PointStamped(header=Header(frame_id="base"))
        )
        chatter = self.create_publisher(String, "chatter", 10)
        self.create_timer(0.05, lambda: chatter.publish(String(data="hello")))
        self.create_publisher(Float64, "_hidden", 10)
        self.create_subscription(Float64, "speed", lambda _: None, qos_profile_sensor_data)
        self.create_service(SetBool, "switch", self._switch)

    @staticmethod
    def _switch(request: Any, response: Any) -> Any:
        response.success, response.message = request.data, "switched"
        return response


@contextmanager
def in_domain(make: Callable[[Context], Any], domain_id: int) -> Iterator[Any]:
    """A node in a domain, which a thread spins."""
    context = Context()
    context.init([], domain_id=domain_id)
    node = make(context)
    with spinning(MultiThreadedExecutor(2, context=context), node):
        yield node
    node.destroy_node()
    context.try_shutdown()


@pytest.fixture(scope="module")
def lab(module_domain_id: int) -> Iterator[Lab]:
    with in_domain(Lab, module_domain_id) as lab:
        yield lab


Ros2 = Callable[..., "subprocess.CompletedProcess[str]"]
Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def start(module_domain_id: int) -> Iterator[Start]:
    """Starts a command in the domain of the module; the test's end kills it."""
    started: list[subprocess.Popen[str]] = []

    def start(*arguments: str, **options: Any) -> subprocess.Popen[str]:
        environment = os.environ | {"ROS_DOMAIN_ID": str(module_domain_id)}
        pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        command = [sys.executable, "-c", PROGRAM, *arguments]
        process = subprocess.Popen(command, text=True, env=environment, **{**pipes, **options})
        started.append(process)
        return process

    yield start
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.fixture
def ros2(start: Start) -> Ros2:
    def run(*arguments: str, input: str | None = None) -> subprocess.CompletedProcess[str]:
        options = {} if input is None else {"stdin": subprocess.PIPE}
        process = start(*arguments, **options)
        out, err = process.communicate(input, timeout=TIMEOUT)
        return subprocess.CompletedProcess(arguments, process.returncode, out, err)

    return run
