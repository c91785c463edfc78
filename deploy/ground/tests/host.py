"""Network namespaces that look like hosts to the processes in them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

TIMEOUT = 20.0  # s
ADDRESS = "192.168.77.1/24"
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"

# Prints "ready", publishes its name, and prints the names of other nodes, until its standard input ends.
NODE = """
import sys, threading
import rclpy
from rclpy.node import Node
from std_msgs.msg import String

name = sys.argv[1]
rclpy.init(args=[])
node = Node(name)
publisher = node.create_publisher(String, "names", 10)
node.create_timer(0.05, lambda: publisher.publish(String(data=name)))
node.create_subscription(String, "names", lambda m: m.data != name and print(m.data, flush=True), 10)
print("ready", flush=True)
threading.Thread(target=lambda: (sys.stdin.read(), rclpy.try_shutdown())).start()
while rclpy.ok():
    rclpy.spin_once(node, timeout_sec=0.1)
"""


def wait_until(condition: Callable[[], object], seconds: float = TIMEOUT) -> None:
    """Wait for a condition. Raises AssertionError if it does not come in time."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"not within {seconds} s"
        time.sleep(0.02)


class Process:
    def __init__(self, command: list[str], environment: dict[str, str], output: Path) -> None:
        self._output = output
        with output.open("w") as file:
            self._process = subprocess.Popen(
                command,
                env={**os.environ, "ROS_DOMAIN_ID": "0", **environment},
                stdin=subprocess.PIPE,
                stdout=file,
                stderr=subprocess.STDOUT,
            )

    def lines(self) -> list[str]:
        lines = self._output.read_text().splitlines()
        assert not self._process.poll(), lines
        return lines

    def wait_ready(self) -> None:
        wait_until(lambda: "ready" in self.lines())

    def end(self) -> None:
        try:
            self._process.communicate(timeout=TIMEOUT)
        finally:
            self._process.kill()
            self._process.wait()


class Host:
    """A network namespace that looks like a host to the processes in it: loopback and other interfaces."""

    def __init__(self, namespace: list[str], directory: Path) -> None:
        self._directory = directory
        self._processes = ExitStack()
        # The namespace exists as long as this process.
        self._holder = subprocess.Popen(
            ["unshare", *namespace, "sh", "-c", "echo ready; exec cat"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self._holder.stdout is not None
        if self._holder.stdout.readline() != "ready\n":
            raise OSError(self._holder.communicate()[1].strip())
        own_user = ["--user", "--preserve-credentials"] if "--user" in namespace else []
        self.enter = ["nsenter", f"--target={self._holder.pid}", "--net", *own_user]
        self.ip("link set lo up")

    def run(self, *command: str) -> str:
        done = subprocess.run(
            [*self.enter, *command],
            env={**os.environ, "ROS_DOMAIN_ID": "0"},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise OSError(f"{' '.join(command)}: {done.stderr.strip()}")
        return done.stdout

    def ip(self, arguments: str) -> None:
        self.run("ip", *arguments.split())

    def add_interface(self, name: str, *addresses: str) -> None:
        self.ip(f"link add {name} type veth peer name {name}-end")
        for end in (name, f"{name}-end"):
            self.ip(f"link set {end} addrgenmode none")  # the kernel sends nothing of its own
        for address in addresses:
            self.ip(f"address add {address} dev {name} {'nodad' if ':' in address else ''}")
        for end in (name, f"{name}-end"):
            self.ip(f"link set {end} up")

    def sent(self, name: str) -> int:
        lines = self.run("cat", "/proc/net/dev").splitlines()
        return next(int(line.split()[9]) for line in lines if line.split()[0] == f"{name}:")

    def start(self, program: str, name: str, **environment: str) -> Process:
        command = [*self.enter, sys.executable, "-c", program, name]
        process = Process(command, environment, self._directory / f"{name}.out")
        self._processes.callback(process.end)
        return process

    def start_node(self, name: str, discovery_range: str) -> Process:
        return self.start(NODE, name, **{RANGE: discovery_range})

    def close(self) -> None:
        self._processes.close()
        self._holder.communicate()
