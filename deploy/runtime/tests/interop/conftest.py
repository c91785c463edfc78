"""A peer on Fast DDS, built when the tests begin, and a node that talks to it."""

from __future__ import annotations

import hashlib
import os
import queue
import shutil
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

SOURCE = Path(__file__).with_name("peer.cpp")
LIBRARIES = ("-lfastrtps", "-lfastcdr")
SECONDS = 15.0  # until discovery or a message must have come


@pytest.fixture(scope="session")
def peer_program(pytestconfig: pytest.Config, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The peer's program; built anew when its source has changed."""
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("no g++ here: apt-get install g++ libfastrtps-dev")
    header = subprocess.run(
        [
            compiler,
            "-x",
            "c++",
            "-fsyntax-only",
            "-include",
            "fastdds/dds/topic/TypeSupport.hpp",
            "/dev/null",
        ],
        capture_output=True,
        check=False,
    )
    if header.returncode:
        pytest.skip("no Fast DDS here: apt-get install libfastrtps-dev")
    cache = getattr(pytestconfig, "cache", None)
    folder = cache.mkdir("interop") if cache is not None else tmp_path_factory.mktemp("interop")
    program: Path = folder / hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]
    if not program.exists():
        built = tmp_path_factory.mktemp("build") / "peer"
        options = ["-std=c++17", "-O1", "-Wall", "-Wextra", "-Werror"]
        subprocess.run([compiler, *options, "-o", str(built), str(SOURCE), *LIBRARIES], check=True)
        # Its name has all of it or nothing: from another file system it is copied.
        os.replace(shutil.copy(built, program.with_suffix(".new")), program)
    return program


class FastPeer:
    """A process with Fast DDS readers and writers, named by their DDS topics."""

    def __init__(self, program: Path, domain_id: int) -> None:
        self._process = subprocess.Popen(
            [str(program), str(domain_id)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
        )
        self._told: queue.Queue[list[str]] = queue.Queue()
        self._listener = threading.Thread(target=self._listen)
        self._listener.start()
        self.heard: list[list[str]] = []

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._told.put(line.split())

    def _say(self, *words: str) -> None:
        assert self._process.stdin is not None
        print(*words, file=self._process.stdin, flush=True)

    def create(
        self,
        kind: str,
        topic: str,
        type_name: str,
        *,
        reliability: str = "reliable",
        durability: str = "volatile",
        user_data: str = "",
    ) -> None:
        """Create a ``reader`` or a ``writer``."""
        self._say(kind, topic, type_name, reliability, durability, user_data)

    def send(self, topic: str, data: bytes) -> None:
        """Write CDR with its encapsulation header."""
        self._say("send", topic, data.hex())

    def hears(self, *words: str) -> bool:
        """Whether the peer has told something that begins with these words."""
        while not self._told.empty():
            self.heard.append(self._told.get())
        return any(line[: len(words)] == list(words) for line in self.heard)

    def samples(self, topic: str) -> list[bytes]:
        """What the peer has read on a topic so far."""
        self.hears()
        return [bytes.fromhex(line[2]) for line in self.heard if line[:2] == ["sample", topic]]

    def close(self) -> None:
        """End the process; it says goodbye to DDS."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        try:
            self._process.wait(10)
        finally:
            self._process.kill()
            self._process.wait()
            self._listener.join()
            self._process.stdout.close()


@pytest.fixture
def peer(peer_program: Path, domain_id: int) -> Iterator[FastPeer]:
    """A Fast DDS peer in the test's domain."""
    peer = FastPeer(peer_program, domain_id)
    yield peer
    peer.close()


@pytest.fixture
def node(domain_id: int) -> Iterator[Node]:
    """A node in the test's domain, in LOCALHOST as the peer is."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    node = Node("ours", context=context)
    yield node
    node.destroy_node()
    context.shutdown()


@pytest.fixture
def spin_until(node: Node) -> Iterator[Callable[[Callable[[], object]], None]]:
    """Runs the node until a condition is true; fails when that takes too long."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)

    def spin(condition: Callable[[], object]) -> None:
        deadline = time.monotonic() + SECONDS
        while not condition():
            assert time.monotonic() < deadline, f"not within {SECONDS} s"
            executor.spin_once(timeout_sec=0.02)

    yield spin
    executor.shutdown()
