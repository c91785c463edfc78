"""Cyclone's configuration for the environment, and the errors in the environment."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from deploy.ground.tests.nodes import MakeNode
from rclpy.context import Context

from rclpy_ground.cyclonedds import domain
from rclpy_ground.cyclonedds.entities import Participant
from rclpy_ground.genuine import RCLError

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
UP, LOOPBACK = 0x1, 0x8  # flags of network interfaces


@pytest.fixture(autouse=True)
def names(monkeypatch: pytest.MonkeyPatch) -> None:
    def look_up(name: str, *_: object) -> list[object]:
        if name == "nowhere":
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")
        return []

    monkeypatch.setattr(socket, "getaddrinfo", look_up)


@pytest.fixture
def interfaces(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int]]:
    """The network interfaces of the host, which a test may change: lo and eth0."""
    interfaces = [("lo", UP | LOOPBACK), ("eth0", UP)]
    monkeypatch.setattr(domain, "ipv4_interfaces", lambda: interfaces)
    return interfaces


# The domain


@pytest.mark.parametrize(("text", "number"), [("", 0), ("42", 42)])
def test_environment_chooses_the_domain(text: str, number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    context = Context()
    context.init([])
    assert context.get_domain_id() == number
    context.shutdown()


@pytest.mark.parametrize("text", ["-1", "233", "one", "4.2", str(2**64)])
def test_invalid_domain_is_one_line(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(RCLError, match=rf"^[^\n]* {text}$"):
        Context().init([])


# Discovery ranges

AUTO = "<ParticipantIndex>auto</ParticipantIndex>"
NO_MULTICAST = "<AllowMulticast>false</AllowMulticast>"
FOREVER = '<Peer address="127.0.0.1" PruneDelay="inf"/>'
FROM_ANY_INTERFACE = "<ExtendedPacketInfo>false</ExtendedPacketInfo>"


@pytest.mark.parametrize(
    ("environment", "has", "lacks"),
    [
        ({RANGE: "LOCALHOST"}, [NO_MULTICAST, AUTO, FOREVER, "<SPDPInterval>8s</SPDPInterval>"], []),
        (
            {},  # SUBNET
            [AUTO, '<Peers><Peer address="127.0.0.1"/></Peers>', FROM_ANY_INTERFACE],
            ["Multicast", "<SPDPInterval>"],
        ),
        ({RANGE: "OFF"}, [NO_MULTICAST, "<Tag>ros_discovery_off_"], []),
        (
            {"ROS_STATIC_PEERS": "robot1; 10.0.0.7"},
            ['<Peer address="robot1"/><Peer address="10.0.0.7"/>'],
            ["Multicast"],
        ),
        (
            {RANGE: "LOCALHOST", "ROS_STATIC_PEERS": "robot1"},
            [NO_MULTICAST, f'{FOREVER}<Peer address="robot1"/>', FROM_ANY_INTERFACE],
            ["<NetworkInterface"],
        ),
    ],
    ids=["LOCALHOST", "SUBNET", "OFF", "SUBNET with peers", "LOCALHOST with peers"],
)
def test_each_range_has_its_settings(environment: dict[str, str], has: list[str], lacks: list[str]) -> None:
    configuration = domain.configuration(environment)
    assert [text for text in has if text not in configuration] == []
    assert [text for text in lacks if text in configuration] == []


@pytest.mark.parametrize("discovery_range", ["LOCALHOST", "SUBNET"])
@pytest.mark.parametrize(("domain_id", "last"), [(0, 100), (231, 100), (232, 62)])
def test_every_index_has_ports(discovery_range: str, domain_id: int, last: int) -> None:
    configuration = domain.configuration({RANGE: discovery_range}, domain_id)
    assert f"<MaxAutoParticipantIndex>{last}</MaxAutoParticipantIndex>" in configuration


def test_localhost_uses_loopback_and_default_interface(interfaces: list[tuple[str, int]]) -> None:
    interfaces[:0] = [("eth1", UP)]
    configuration = domain.configuration({RANGE: "LOCALHOST"})
    assert configuration.count("<NetworkInterface ") == 2
    assert (
        '<Interfaces><NetworkInterface name="lo" allow_multicast="false"/>'
        '<NetworkInterface autodetermine="true" allow_multicast="false"/></Interfaces>'
    ) in configuration


def test_localhost_without_other_interface_uses_loopback(interfaces: list[tuple[str, int]]) -> None:
    interfaces[:] = [("lo", UP | LOOPBACK), ("lo", UP | LOOPBACK)]
    configuration = domain.configuration({RANGE: "LOCALHOST"})
    assert '<Interfaces><NetworkInterface name="lo" allow_multicast="false"/></Interfaces>' in configuration


def test_localhost_without_loopback_is_an_error(interfaces: list[tuple[str, int]]) -> None:
    interfaces[:] = [("eth0", UP)]
    with pytest.raises(RCLError, match=r"^the loopback interface is down"):
        domain.configuration({RANGE: "LOCALHOST"})


def test_localhost_without_loopback_leaves_the_choice_to_cyclone(
    interfaces: list[tuple[str, int]],
) -> None:
    interfaces[:] = [("eth0", UP)]
    configuration = domain.configuration({RANGE: "LOCALHOST", "ROS_STATIC_PEERS": "10.0.0.7"})
    assert "<NetworkInterface" not in configuration
    assert "<ExtendedPacketInfo>false</ExtendedPacketInfo>" in configuration


@pytest.mark.parametrize(
    ("environment", "large"),
    [
        ({RANGE: "LOCALHOST"}, True),
        ({RANGE: "LOCALHOST", "ROS_STATIC_PEERS": "10.0.0.7"}, False),
        ({RANGE: "LOCALHOST", "CYCLONEDDS_URI": "<NetworkInterface/>"}, False),
        ({RANGE: "SUBNET"}, False),
    ],
)
def test_only_what_stays_on_the_host_is_in_large_datagrams(environment: dict[str, str], large: bool) -> None:
    assert ("<MaxMessageSize>65000 B</MaxMessageSize>" in domain.configuration(environment)) == large


@pytest.mark.parametrize(
    ("largest_socket", "limited"), [("212992\n", False), ("4194304\n", True), ("", False), (None, False)]
)
def test_first_burst_fits_into_a_large_socket(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, largest_socket: str | None, limited: bool
) -> None:
    file = tmp_path / "rmem_max"
    if largest_socket is not None:
        file.write_text(largest_socket)
    monkeypatch.setattr(domain, "_LARGEST_SOCKET", file)
    configuration = domain.configuration({RANGE: "LOCALHOST"})
    assert ("<MaxInitTransmit>90</MaxInitTransmit>" in configuration) == limited
    assert '<SocketReceiveBufferSize max="16 MiB"/>' in configuration


def test_interfaces_of_the_host_are_listed() -> None:
    found = domain.ipv4_interfaces()
    assert {name for name, _ in found} <= {name for _, name in socket.if_nameindex()}
    assert all(flags & UP for _, flags in found)
    assert [name for name, flags in found if flags & LOOPBACK]


@pytest.mark.parametrize("discovery_range", ["OFF", "SUBNET", "SYSTEM_DEFAULT"])
def test_localhost_only_variable_overrides_range_and_peers(discovery_range: str) -> None:
    new = {RANGE: discovery_range, "ROS_STATIC_PEERS": "robot1"}
    old = domain.configuration({**new, "ROS_LOCALHOST_ONLY": "1"})
    assert old == domain.configuration({RANGE: "LOCALHOST"})
    assert domain.configuration({**new, "ROS_LOCALHOST_ONLY": "0"}) == domain.configuration(new)


def test_system_default_leaves_all_to_cyclone() -> None:
    assert domain.configuration({RANGE: "SYSTEM_DEFAULT", "ROS_STATIC_PEERS": "robot1"}) == ""


def test_unknown_range_is_one_line() -> None:
    with pytest.raises(RCLError, match=r"^ROS_AUTOMATIC_DISCOVERY_RANGE must be one of .*, not 'MOON'$"):
        domain.configuration({RANGE: "moon"})


# Static peers


NODE = """
import faulthandler
faulthandler.dump_traceback_later(60, exit=True)  # a process that hangs must not hang the test
import rclpy
rclpy.init(args=[])
node = rclpy.create_node("other")
input()
"""


def test_process_with_peers_meets_process_without(make_node: MakeNode, domain_id: int) -> None:
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain_id), "ROS_STATIC_PEERS": "127.0.0.1"}
    with subprocess.Popen([sys.executable, "-c", NODE], env=environment, stdin=subprocess.PIPE) as process:
        assert make_node().wait_for_node("/other", 10)
        process.communicate(b"\n")


def test_peer_without_address_is_ignored(capsys: pytest.CaptureFixture[str]) -> None:
    configuration = domain.configuration({"ROS_STATIC_PEERS": "nowhere;10.0.0.7;robot1:7410"})
    assert configuration == domain.configuration({"ROS_STATIC_PEERS": "10.0.0.7;robot1:7410"})
    assert capsys.readouterr().err == (
        "[WARN] ROS_STATIC_PEERS: 'nowhere' is ignored: Name or service not known\n"
    )


def test_invalid_peers_are_one_line() -> None:
    with pytest.raises(RCLError, match=r"^ROS_STATIC_PEERS must be addresses or host names"):
        domain.configuration({"ROS_STATIC_PEERS": '"/><Evil'})


# CYCLONEDDS_URI


def test_settings_of_the_user_come_last() -> None:
    own = "<CycloneDDS><Domain/></CycloneDDS>"
    assert domain.configuration({RANGE: "LOCALHOST", "CYCLONEDDS_URI": own}).endswith(f",{own}")


INTERFACES = '<General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces></General>'


@pytest.mark.parametrize(
    ("form", "only"),
    [
        ("<CycloneDDS><Domain>{}</Domain></CycloneDDS>", True),
        ("<CycloneDDS><Domain><!--\n{}\n--></Domain></CycloneDDS>", False),
        ("<CycloneDDS><Domain/></CycloneDDS>", False),
    ],
    ids=["named", "in a comment", "not named"],
)
@pytest.mark.parametrize("where", ["text", "file", "file: URI", "second of two"])
def test_only_interfaces_of_the_user_are_used(
    form: str, only: bool, where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, domain_id: int
) -> None:
    text = form.format(INTERFACES)
    path = tmp_path / "cyclonedds.xml"
    path.write_text(text)
    uri = {
        "text": text,
        "file": f"{path}",
        "file: URI": f"file://{path}",
        "second of two": f"<CycloneDDS><Domain/></CycloneDDS>, file://{path}",
    }[where]
    monkeypatch.setenv("CYCLONEDDS_URI", uri)
    own = domain.configuration().removesuffix(uri)
    assert ("<NetworkInterface" in own) == (not only)
    assert ("<ExtendedPacketInfo>" in own) == only  # or packets to localhost are dropped
    Participant(domain_id, "/").close()  # Cyclone would refuse an interface that is named twice


@pytest.mark.parametrize("transport", ["<Transport>udp6</Transport>", "<UseIPv6>true</UseIPv6>"])
@pytest.mark.parametrize("discovery_range", ["LOCALHOST", "SUBNET"])
def test_transport_of_the_user_finds_its_interface(
    discovery_range: str, transport: str, monkeypatch: pytest.MonkeyPatch, domain_id: int
) -> None:
    monkeypatch.setenv(RANGE, discovery_range)
    uri = f"<CycloneDDS><Domain><General>{transport}</General></Domain></CycloneDDS>"
    monkeypatch.setenv("CYCLONEDDS_URI", uri)
    assert "<NetworkInterface" not in domain.configuration()
    Participant(domain_id, "/").close()
