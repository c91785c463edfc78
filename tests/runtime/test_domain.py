"""How a process joins its DDS domain, and what travels on the wire."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from rclpy._dds import domain
from rclpy.context import Context
from rclpy.exceptions import RCLError
from rclpy.node import Node

MakeNode = Callable[..., Node]
SpinUntil = Callable[..., None]
GOLDEN = json.loads((Path(__file__).parents[1] / "facts" / "cdr_golden.json").read_text())


def test_the_domain_is_0_unless_the_environment_says_otherwise() -> None:
    assert domain.domain_id_from_environment({}) == 0
    assert domain.domain_id_from_environment({"ROS_DOMAIN_ID": "42"}) == 42


@pytest.mark.parametrize("text", ["-1", "233", "one", "4.2"])
def test_a_domain_that_is_none_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(RCLError, match=r"^ROS_DOMAIN_ID must be a whole number from 0 to 232, not '"):
        domain.domain_id_from_environment({"ROS_DOMAIN_ID": text})


def test_localhost_uses_loopback_only() -> None:
    configuration = domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})
    assert '<NetworkInterface name="lo" multicast="true"/>' in configuration
    assert '<Peer address="localhost"/>' in configuration


def test_the_deprecated_localhost_only_variable_is_still_obeyed() -> None:
    old = domain.configuration({"ROS_LOCALHOST_ONLY": "1"})
    assert old == domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})


def test_subnet_and_system_default_leave_cyclone_to_its_own_defaults() -> None:
    assert domain.configuration({}) == ""
    assert domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}) == ""


def test_off_hides_a_process_from_all_others() -> None:
    configuration = domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"})
    assert "<AllowMulticast>false</AllowMulticast>" in configuration
    assert "<Tag>ros_discovery_off_" in configuration


def test_static_peers_are_asked_besides() -> None:
    configuration = domain.configuration({"ROS_STATIC_PEERS": "robot1; 10.0.0.7"})
    assert '<Peer address="robot1"/><Peer address="10.0.0.7"/>' in configuration


def test_settings_of_cyclonedds_uri_come_last_and_win() -> None:
    own = "<CycloneDDS><Domain/></CycloneDDS>"
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "CYCLONEDDS_URI": own}
    assert domain.configuration(environment).endswith(f",{own}")


def test_network_interfaces_of_cyclonedds_uri_are_the_only_ones() -> None:
    interfaces = '<Interfaces><NetworkInterface name="lo"/></Interfaces>'
    own = f"<CycloneDDS><Domain><General>{interfaces}</General></Domain></CycloneDDS>"
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "CYCLONEDDS_URI": own}
    assert domain.configuration(environment).count("<NetworkInterface") == 1


def test_an_unknown_range_is_refused_in_one_line() -> None:
    with pytest.raises(RCLError, match=r"^ROS_AUTOMATIC_DISCOVERY_RANGE must be one of .*, not 'MOON'$"):
        domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "moon"})


def test_peers_that_are_no_addresses_are_refused() -> None:
    with pytest.raises(RCLError, match="ROS_STATIC_PEERS"):
        domain.configuration({"ROS_STATIC_PEERS": '"/><Evil'})


def test_a_context_forgets_the_shutdown_callbacks_of_objects_that_are_gone(context: Context) -> None:
    class Listener:
        def hear(self) -> None: ...

    context.on_shutdown(Listener().hear)
    assert context._callbacks == []
