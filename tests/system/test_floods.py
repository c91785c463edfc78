"""Floods of discovery and of /diagnostics: the sentinel replaces a hung service, and no healthy one."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import closing

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import serialize_message

from interfaces import topics
from tests.system.sites import LIMIT, STEADY, Peer, Site

FLOOD = 12.0  # s: four times as long as a healthy service may be silent
RATE = 20_000  # packets of discovery a second


def start(site: Site) -> dict[str, int]:
    command = site.begin("start", STEADY)
    command.await_line("It runs in the background")
    return site.members


def sentinel_log(site: Site) -> str:
    return (site.run / "logs" / "sentinel.log").read_text(errors="replace")


def hang(site: Site, program: str, meanwhile: Callable[[], object]) -> None:
    """Stop a process, and wait until it is replaced."""
    before = site.members[program]
    os.kill(before, signal.SIGSTOP)
    deadline = time.monotonic() + LIMIT
    while site.members.get(program, before) == before:
        assert time.monotonic() < deadline, sentinel_log(site)
        meanwhile()


@pytest.mark.parametrize(("kind", "participants"), [("identities", 3), ("replays", 20), ("garbage", 20)])
def test_flood_of_discovery_kills_only_a_hung_service(site: Site, kind: str, participants: int) -> None:
    before = start(site)
    arguments = (str(site.domain), kind, str(FLOOD + LIMIT), str(RATE), str(participants))
    flood = site.begin_command(sys.executable, "-m", "tests.system.discovery_flood", *arguments)
    end = time.monotonic() + FLOOD
    while time.monotonic() < end:
        assert site.members == before, sentinel_log(site)
        time.sleep(0.5)
    hang(site, "kinematics", lambda: time.sleep(0.1))
    flood.signal(signal.SIGKILL)
    assert "flood: more than" in sentinel_log(site)


def test_flood_of_diagnostics_kills_only_a_hung_service(site: Site) -> None:
    before = start(site)
    octets = serialize_message(DiagnosticArray(status=[DiagnosticStatus(name="wheel: motor")]))
    with closing(Peer(site.domain)) as peer:
        publisher = peer.publisher(topics.DIAGNOSTICS)

        def publish() -> None:
            for _ in range(50):
                publisher.publish(octets)
            time.sleep(0.0155)

        end = time.monotonic() + FLOOD
        while time.monotonic() < end:
            publish()
        assert site.members == before, sentinel_log(site)
        hang(site, "kinematics", publish)
    assert "reports of health are lost, most of them about 'wheel: motor'" in sentinel_log(site)
    assert "'/peer'" in sentinel_log(site)
