"""The DDS domain of a process: its identifier, interfaces, peers and Cyclone's configuration."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from rclpy._dds import Participant, domain
from rclpy.exceptions import RCLError
from rclpy.node import Node

MakeNode = Callable[..., Node]


@pytest.fixture(autouse=True)
def name_lookup(monkeypatch: pytest.MonkeyPatch) -> None:
    """Resolves every host name except ``nowhere``."""

    def look_up(name: str, *_: object) -> list[object]:
        if name == "nowhere":
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")
        return []

    monkeypatch.setattr(socket, "getaddrinfo", look_up)


def test_a_peer_without_an_address_is_ignored_with_a_warning(capsys: pytest.CaptureFixture[str]) -> None:
    configuration = domain.configuration({"ROS_STATIC_PEERS": "nowhere;10.0.0.7;robot1:7410"})
    assert configuration == domain.configuration({"ROS_STATIC_PEERS": "10.0.0.7;robot1:7410"})
    assert capsys.readouterr().err == (
        "[WARN] ROS_STATIC_PEERS: 'nowhere' is ignored: Name or service not known\n"
    )


def test_the_domain_id_defaults_to_0() -> None:
    assert domain.domain_id_from_environment({}) == 0
    assert domain.domain_id_from_environment({"ROS_DOMAIN_ID": "42"}) == 42


@pytest.mark.parametrize("text", ["-1", "233", "one", "4.2"])
def test_an_invalid_domain_id_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(RCLError, match=r"^ROS_DOMAIN_ID must be a whole number from 0 to 232, not '"):
        domain.domain_id_from_environment({"ROS_DOMAIN_ID": text})


def test_localhost_uses_loopback_only() -> None:
    configuration = domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})
    assert '<NetworkInterface name="lo" multicast="true"/>' in configuration
    assert '<Peer address="localhost"/>' in configuration


def test_the_deprecated_localhost_only_variable_still_works() -> None:
    old = domain.configuration({"ROS_LOCALHOST_ONLY": "1"})
    assert old == domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})


@pytest.mark.parametrize("discovery_range", ["OFF", "SUBNET", "SYSTEM_DEFAULT"])
def test_localhost_only_overrides_range_and_peers(discovery_range: str) -> None:
    new = {"ROS_AUTOMATIC_DISCOVERY_RANGE": discovery_range, "ROS_STATIC_PEERS": "robot1"}
    old = domain.configuration({**new, "ROS_LOCALHOST_ONLY": "1"})
    assert old == domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})
    assert domain.configuration({**new, "ROS_LOCALHOST_ONLY": "0"}) == domain.configuration(new)


def test_subnet_takes_a_participant_index_and_keeps_multicast() -> None:
    configuration = domain.configuration({})
    assert "<ParticipantIndex>auto</ParticipantIndex>" in configuration
    assert "<Peer " not in configuration
    assert "Multicast" not in configuration


def test_system_default_configures_nothing() -> None:
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT", "ROS_STATIC_PEERS": "robot1"}
    assert domain.configuration(environment) == ""


def test_off_hides_a_process_from_all_others() -> None:
    configuration = domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"})
    assert "<AllowMulticast>false</AllowMulticast>" in configuration
    assert "<Tag>ros_discovery_off_" in configuration


def test_static_peers_are_added() -> None:
    configuration = domain.configuration({"ROS_STATIC_PEERS": "robot1; 10.0.0.7"})
    assert '<Peer address="robot1"/><Peer address="10.0.0.7"/>' in configuration


def test_localhost_with_static_peers_uses_any_interface_without_multicast() -> None:
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": "robot1"}
    configuration = domain.configuration(environment)
    assert '<Peer address="localhost"/><Peer address="robot1"/>' in configuration
    assert "<AllowMulticast>false</AllowMulticast>" in configuration
    assert "<ExtendedPacketInfo>false</ExtendedPacketInfo>" in configuration
    assert "<NetworkInterface" not in configuration


NODE = """
import rclpy
rclpy.init(args=[])
node = rclpy.create_node("other")
input()
"""


def test_localhost_processes_with_and_without_peers_meet(make_node: MakeNode, domain_id: int) -> None:
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain_id), "ROS_STATIC_PEERS": "127.0.0.1"}
    with subprocess.Popen([sys.executable, "-c", NODE], env=environment, stdin=subprocess.PIPE) as process:
        assert make_node().wait_for_node("/other", 10)
        process.communicate(b"\n")


def test_settings_of_cyclonedds_uri_come_last_and_win() -> None:
    settings = "<CycloneDDS><Domain/></CycloneDDS>"
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "CYCLONEDDS_URI": settings}
    assert domain.configuration(environment).endswith(f",{settings}")


LOOPBACK = '<General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces></General>'


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
def test_network_interfaces_of_cyclonedds_uri_replace_the_default(
    form: str, only: bool, where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, domain_id: int
) -> None:
    text = form.format(LOOPBACK)
    path = tmp_path / "cyclonedds.xml"
    path.write_text(text)
    uri = {
        "text": text,
        "file": f"{path}",
        "file: URI": f"file://{path}",
        "second of two": f"<CycloneDDS><Domain/></CycloneDDS>, file://{path}",
    }[where]
    monkeypatch.setenv("CYCLONEDDS_URI", uri)
    assert domain.configuration().removesuffix(uri).count("<NetworkInterface") == (not only)
    Participant(domain_id, "enclave=/;").close()  # Cyclone refuses an interface that is named twice


def test_an_unknown_range_is_refused_in_one_line() -> None:
    with pytest.raises(RCLError, match=r"^ROS_AUTOMATIC_DISCOVERY_RANGE must be one of .*, not 'MOON'$"):
        domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "moon"})


def test_invalid_peers_are_refused() -> None:
    with pytest.raises(RCLError, match="ROS_STATIC_PEERS"):
        domain.configuration({"ROS_STATIC_PEERS": '"/><Evil'})
