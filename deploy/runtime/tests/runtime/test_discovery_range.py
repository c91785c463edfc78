"""Which nodes of a host meet, and which packets they send: in network namespaces with other interfaces."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
TIMEOUT = 20.0  # s
ADDRESS = "192.168.77.1/24"

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

# Counts the RTPS packets of the loopback interface, and those that contain RTPS's multicast group, to which
# packets go or which a locator announces.
SNIFFER = """
import select, socket, sys

group = bytes([239, 255, 0, 1])
packets = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3))
packets.bind(("lo", 0))
packets.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
print("ready", flush=True)
rtps = multicast = 0
while True:
    readable, _, _ = select.select([packets, sys.stdin], [], [])
    if packets in readable:
        data = packets.recv(65536)
        rtps += b"RTPS" in data
        multicast += b"RTPS" in data and group in data
    elif not sys.stdin.read():
        break
print(rtps, multicast, flush=True)
"""


ONE_NODE = "import rclpy; rclpy.init(); rclpy.create_node('node')"

# Takes the ports of the first participant indices until its standard input ends.
PORTS = """
import socket, sys

taken = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(int(sys.argv[1]))]
for index, port in enumerate(taken):
    port.bind(("", 7410 + 2 * index))
print("ready", flush=True)
sys.stdin.read()
"""


def wait_until(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < deadline, f"not within {TIMEOUT} s"
        time.sleep(0.02)


class Process:
    """A Python program on a host, with its output so far."""

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
        """Close its standard input and wait until it has ended."""
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
        self._enter = ["nsenter", f"--target={self._holder.pid}", "--net", *own_user]
        self.ip("link set lo up")

    def run(self, *command: str) -> str:
        done = subprocess.run(
            [*self._enter, *command],
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
        """Add an interface with a cable to nothing."""
        self.ip(f"link add {name} type veth peer name {name}-end")
        for end in (name, f"{name}-end"):
            self.ip(f"link set {end} addrgenmode none")  # the kernel sends nothing of its own
        for address in addresses:
            self.ip(f"address add {address} dev {name} {'nodad' if ':' in address else ''}")
        for end in (name, f"{name}-end"):
            self.ip(f"link set {end} up")

    def sent(self, name: str) -> int:
        """Return the number of packets that an interface has sent."""
        lines = self.run("cat", "/proc/net/dev").splitlines()
        return next(int(line.split()[9]) for line in lines if line.split()[0] == f"{name}:")

    def start(self, program: str, name: str, **environment: str) -> Process:
        command = [*self._enter, sys.executable, "-c", program, name]
        process = Process(command, environment, self._directory / f"{name}.out")
        self._processes.callback(process.end)
        return process

    def start_node(self, name: str, discovery_range: str) -> Process:
        return self.start(NODE, name, **{RANGE: discovery_range})

    def close(self) -> None:
        self._processes.close()
        self._holder.communicate()


@pytest.fixture
def host(tmp_path: Path) -> Iterator[Host]:
    """A host with the loopback interface only."""
    for program, package in (("ip", "iproute2"), ("unshare", "util-linux"), ("nsenter", "util-linux")):
        if shutil.which(program) is None:
            pytest.skip(f"no {program} here: apt-get install {package}")
    namespaces = [["--net"]] if os.geteuid() == 0 else []
    with ExitStack() as stack:
        for namespace in (*namespaces, ["--user", "--map-root-user", "--net"]):
            try:
                host = Host(namespace, tmp_path)
                stack.callback(host.close)
                host.add_interface("probe")
                host.ip("link delete probe")
            except OSError as error:
                reason = error
            else:
                break
        else:
            pytest.skip(f"platform: no network namespaces here: {reason}")
        yield host


@pytest.fixture
def host_with_network(host: Host) -> Host:
    """A host with another interface, eth0."""
    host.add_interface("eth0", ADDRESS)
    return host


def assert_meet(first: Process, second: Process) -> None:
    """Both nodes get messages of the other."""
    wait_until(lambda: "second" in first.lines())
    wait_until(lambda: "first" in second.lines())


@pytest.mark.parametrize("discovery_range", ["LOCALHOST", "SUBNET", "OFF", "SYSTEM_DEFAULT"])
def test_a_node_without_any_interface_names_the_loopback(discovery_range: str, host: Host) -> None:
    host.ip("link set lo down")
    with pytest.raises(OSError, match=r"RCLError: the loopback interface is down.*`ip link set lo up`"):
        host.run("env", f"{RANGE}={discovery_range}", sys.executable, "-c", ONE_NODE)


def test_a_node_in_localhost_needs_the_loopback(host_with_network: Host) -> None:
    host_with_network.ip("link set lo down")
    with pytest.raises(OSError, match="RCLError: the loopback interface is down"):
        host_with_network.run("env", f"{RANGE}=LOCALHOST", sys.executable, "-c", ONE_NODE)


@pytest.mark.parametrize("ranges", [("LOCALHOST", "SUBNET"), ("SUBNET", "LOCALHOST")])
def test_localhost_and_subnet_meet(ranges: tuple[str, str], host_with_network: Host) -> None:
    first = host_with_network.start_node("first", ranges[0])
    first.wait_ready()
    second = host_with_network.start_node("second", ranges[1])
    assert_meet(first, second)


@pytest.mark.parametrize("uri", ["", "<General><AllowMulticast>true</AllowMulticast></General>"])
def test_nothing_leaves_the_host_in_localhost(
    uri: str, host_with_network: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", uri)
    first = host_with_network.start_node("first", "LOCALHOST")
    second = host_with_network.start_node("second", "LOCALHOST")
    assert_meet(first, second)
    wait_until(lambda: len(second.lines()) > 20)
    assert host_with_network.sent("eth0") == 0
    host_with_network.start_node("third", "SUBNET")
    wait_until(lambda: host_with_network.sent("eth0") > 0)


@pytest.mark.parametrize("discovery_range", ["LOCALHOST", "SUBNET"])
@pytest.mark.parametrize("interfaces", [[], ["eth0"]], ids=["loopback only", "with network"])
def test_only_subnet_announces_multicast(discovery_range: str, interfaces: list[str], host: Host) -> None:
    for interface in interfaces:
        host.add_interface(interface, ADDRESS)
    sniffer = host.start(SNIFFER, "sniffer")
    sniffer.wait_ready()
    first = host.start_node("first", discovery_range)
    second = host.start_node("second", discovery_range)
    assert_meet(first, second)
    sniffer.end()
    rtps, multicast = map(int, sniffer.lines()[1].split())
    assert rtps > 100
    assert bool(multicast) == (discovery_range == "SUBNET")


def test_nodes_in_localhost_survive_the_network(host_with_network: Host) -> None:
    first = host_with_network.start_node("first", "LOCALHOST")
    second = host_with_network.start_node("second", "LOCALHOST")
    assert_meet(first, second)
    host_with_network.ip("address flush dev eth0")
    for node in (first, second):
        heard = len(node.lines())
        wait_until(lambda: len(node.lines()) > heard + 40)  # noqa: B023 (more than what was on the way)
    third = host_with_network.start_node("third", "LOCALHOST")
    wait_until(lambda: {"first", "second"} <= set(third.lines()))
    wait_until(lambda: "third" in first.lines() and "third" in second.lines())


@pytest.mark.parametrize(
    "addresses",
    [[], ["192.168.77.1/24", "10.0.5.1/16"], ["fd00:77::1/64"], ["fd00:77::1/64", "10.0.5.1/16"]],
    ids=["none", "two", "IPv6", "IPv6 and IPv4"],
)
@pytest.mark.parametrize("discovery_range", ["LOCALHOST", "SUBNET"])
def test_nodes_meet_with_any_interfaces(discovery_range: str, addresses: list[str], host: Host) -> None:
    for number, address in enumerate(addresses):
        host.add_interface(f"eth{number}", address)
    first = host.start_node("first", discovery_range)
    second = host.start_node("second", discovery_range)
    assert_meet(first, second)


def test_hundred_processes_fit_on_a_host(host: Host) -> None:
    host.start(PORTS, "99").wait_ready()
    host.start_node("hundredth", "LOCALHOST").wait_ready()
    with pytest.raises(OSError, match="Failed to find a free participant index"):
        host.run(sys.executable, "-c", "import rclpy; rclpy.init(); rclpy.create_node('one_more')")
