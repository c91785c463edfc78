"""Which arms `make fleet` watches, and the tag that keeps the arms of a ROS domain apart."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from std_msgs.msg import String

from deploy.commands import fleet
from deploy.commands.fleet import Domain, Place, places
from deploy.running import processes
from deploy.running.environment import CYCLONEDDS, set_middleware
from deploy.running.errors import DeploymentError
from reactive_node.domains import reserved_domain

LIMIT = 30.0  # s


def surroundings(namespace: str, domain: int, **given: str) -> dict[str, str]:
    environment = {"RUNTIME": "embedded", "REACTIVE_ARM_NAMESPACE": namespace, "ROS_DOMAIN_ID": str(domain)}
    environment |= given
    set_middleware(environment)
    return environment


@pytest.fixture
def domain() -> Iterator[int]:
    with reserved_domain() as domain:
        yield domain


@pytest.mark.parametrize("reach", ["LOCALHOST", "SUBNET"])
def test_processes_of_one_arm_meet_and_those_of_another_do_not(reach: str, domain: int) -> None:
    names = ("/arm1", "/arm1", "/arm2")
    with ExitStack() as stack:
        nodes = [
            stack.enter_context(
                fleet._joined(
                    fleet.place(surroundings(name, domain, ROS_AUTOMATIC_DISCOVERY_RANGE=reach)).domain,
                    number,
                )
            )
            for number, name in enumerate(names)
        ]
        readers = [node.create_subscription(String, "words", lambda _: None, 1) for node in nodes]
        writer = nodes[0].create_publisher(String, "words", 1)
        deadline = time.monotonic() + LIMIT
        while writer.get_subscription_count() < 2 and time.monotonic() < deadline:
            time.sleep(0.02)
        assert writer.get_subscription_count() == 2
        assert nodes[2].count_publishers("words") == 0
        assert len(readers) == 3


def test_arms_of_this_host_and_named_ones_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    here = surroundings("/arm1", 7)
    monkeypatch.setattr(processes, "systems", lambda: {Path("/run"): here, Path("/same"): here})
    monkeypatch.setenv("ROS_DOMAIN_ID", "3")
    found = places(["/arm2=5", "/arm3"])
    assert sorted({(place.namespace, place.domain.number) for place in found}) == [
        ("/arm1", 7),
        ("/arm2", 5),
        ("/arm3", 3),
    ]
    # The rclpy of an arm on another host is not known: with a tag, or without.
    tags = [dict(place.domain.variables).get(CYCLONEDDS, "") for place in found if place.namespace == "/arm2"]
    assert sorted("<Tag>/arm2</Tag>" in tag for tag in tags) == [False, True]
    assert places([]) == {Place("/arm1", Domain(7, fleet.place(here).domain.variables))}


@pytest.mark.parametrize("name", ["arm1", "/arm1=x", "=5"])
def test_wrong_name_of_an_arm_is_one_line(name: str) -> None:
    with pytest.raises(DeploymentError, match=f"^ARMS: {name} is no arm such as /arm1"):
        places([name])


def test_host_without_an_arm_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "systems", dict)
    with pytest.raises(DeploymentError, match=r"^No arm runs on this host\."):
        fleet.run([])
