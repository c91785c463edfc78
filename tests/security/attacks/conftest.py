"""Keys, a whole arm that joins with them, and peers with other keys or none."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
from rclpy_ground.cyclonedds import security

from deploy.security import rights
from deploy.security.keystore import Keystore
from deploy.supervision import manifest
from deploy.supervision.processes import ROOT
from reactive_node.domains import reserved_domain
from tests.environment import user_environment
from tests.system.sites import LIMIT, Site

ATTEMPTS = 3.0  # s for which a stranger tries
HEARTBEAT, ENGINES, STATE = "operator_heartbeat", "engines", "engines/state"
PROGRAMS = [program.name for program in manifest.programs(manifest.PATH)]


class Refused(Exception):
    """What a peer says of an error."""


class Peer:
    """A process with a node, see peer.py."""

    def __init__(self, node: str, environment: dict[str, str], *arguments: str) -> None:
        command = [sys.executable, "-m", "tests.security.attacks.peer", node, *arguments]
        self._process = subprocess.Popen(
            command, cwd=ROOT, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def joined(self) -> Peer:
        """Return this peer when it has joined; raises Refused if it cannot."""
        self._answer()
        return self

    def __call__(self, method: str, *arguments: Any) -> Any:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps([method, *arguments]) + "\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        answer = json.loads(self._process.stdout.readline())
        if isinstance(answer, dict):
            raise Refused(answer["error"])
        return answer

    def close(self) -> None:
        if self._process.poll() is None:
            self._process.communicate(timeout=LIMIT)


MakePeer = Callable[..., Peer]


@pytest.fixture
def make_peer(secure_site: SecureSite) -> Iterator[MakePeer]:
    """Make a peer that has joined, in the arm's environment with changes; ``None`` removes a variable."""
    with peers(secure_site) as make:
        yield make


@pytest.fixture
def make_open_peer(open_site: Site) -> Iterator[MakePeer]:
    """Make a peer of the arm without keys, as ``make_peer`` does of the one with keys."""
    with peers(open_site) as make:
        yield make


@contextmanager
def peers(site: Site) -> Iterator[MakePeer]:
    """Make peers of an arm, which end with the context."""
    with ExitStack() as stack:

        def make(node: str, enclave: str = "", **changes: str | None) -> Peer:
            environment = {**site.environment, **changes}
            arguments = ["--ros-args", "--enclave", f"/{enclave or node}"]
            given = {name: value for name, value in environment.items() if value is not None}
            return stack.enter_context(closing(Peer(node, given, *arguments))).joined()

        yield make


@pytest.fixture
def watcher(make_peer: MakePeer) -> Peer:
    """A peer with the recorder's keys that hears the state of the engines."""
    return watching(make_peer)


@pytest.fixture
def open_watcher(make_open_peer: MakePeer) -> Peer:
    """A peer that hears the state of the engines of the arm without keys."""
    return watching(make_open_peer)


def watching(make_peer: MakePeer) -> Peer:
    watcher = make_peer("recorder_1", "recorder")
    watcher("read", STATE)
    until(lambda: "off" in watcher("heard", STATE))
    return watcher


def hold_switch_and_turn_on(peer: Peer, watcher: Peer, seconds: float = ATTEMPTS) -> list[str]:
    """Send heartbeats and `turn_on`; return the states of the engines meanwhile."""
    for name in (HEARTBEAT, ENGINES):
        peer("advertise", name)
    states: list[str] = []
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline and "on" not in states:
        peer("publish", HEARTBEAT, True)
        peer("publish", ENGINES, "turn_on")
        states += watcher("heard", STATE)
        time.sleep(0.05)
    return states


def permissions(keystore: Keystore, enclave: str) -> Path:
    return keystore.folder / "enclaves" / enclave / "permissions.p7s"


def until(condition: Callable[[], object], seconds: float = LIMIT) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"not within {seconds} s"
        time.sleep(0.05)


class CycloneSite(Site):
    """A site whose system runs on Cyclone DDS."""

    @property
    def environment(self) -> dict[str, str]:
        return super().environment | {"RUNTIME": "cyclonedds"}


class SecureSite(CycloneSite):
    """A site whose system joins with keys."""

    @property
    def keystore(self) -> Keystore:
        return Keystore(self.run.parent / "keystore")

    @property
    def environment(self) -> dict[str, str]:
        return super().environment | {
            "ROS_SECURITY_ENABLE": "true",
            "ROS_SECURITY_STRATEGY": "Enforce",
            "ROS_SECURITY_KEYSTORE": str(self.keystore.folder),
        }


@pytest.fixture(scope="module")
def secure_site(tmp_path_factory: pytest.TempPathFactory, module_domain_id: int) -> Iterator[SecureSite]:
    """A running arm without a scenario: nobody holds its switch."""
    if security.library(user_environment() | os.environ) is None:
        pytest.skip("no Cyclone DDS with security: apt-get install libddsc0t64")
    with closing(SecureSite(tmp_path_factory.mktemp("secure") / "run", module_domain_id)) as site:
        site.keystore.write(rights.of_arm("/", PROGRAMS), [site.domain])
        start(site)
        yield site


@pytest.fixture(scope="module")
def open_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """The same arm without keys, in a domain of its own: what an attack does there shows that it works."""
    with (
        reserved_domain() as domain,
        closing(CycloneSite(tmp_path_factory.mktemp("open") / "run", domain)) as site,
    ):
        start(site)
        yield site


def start(site: Site) -> None:
    code, output = site.do("start", "none")
    assert code == 0, output
