"""Which nodes of a host meet, and which packets they send: in network namespaces with other interfaces."""

from __future__ import annotations

import sys

import pytest
from deploy.ground.tests.host import ADDRESS, RANGE, Host, Process, wait_until

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


def assert_meet(first: Process, second: Process) -> None:
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
