"""Peers of the tests: ROS 2 nodes, and a program on Fast DDS that is built on first use."""

from __future__ import annotations

import fcntl
import hashlib
import queue
import shutil
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from itertools import count
from pathlib import Path

import pytest
from deploy.runtime.tests.interop.processes import PeerProcess

StartPeer = Callable[..., PeerProcess]
PeerOn = Callable[[str], PeerProcess]
NUMBERS = count()
SOURCE = Path(__file__).with_name("peer.cpp")
LIBRARIES = ("-lfastrtps", "-lfastcdr")


@pytest.fixture(scope="session")
def peer_program(pytestconfig: pytest.Config, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The peer's program, built once for each version of its source."""
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
    with program.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # one worker builds it for all
        if not program.exists():
            built = program.with_suffix(".new")
            options = ["-std=c++17", "-O1", "-Wall", "-Wextra", "-Werror"]
            subprocess.run([compiler, *options, "-o", str(built), str(SOURCE), *LIBRARIES], check=True)
            built.rename(program)  # at once: a program of this name is always complete
    return program


class FastPeer:
    """A process with Fast DDS readers and writers, addressed by their DDS topics."""

    def __init__(self, program: Path, domain_id: int) -> None:
        self._process = subprocess.Popen(
            [str(program), str(domain_id)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
        )
        self._lines: queue.Queue[list[str]] = queue.Queue()
        self._reader = threading.Thread(target=self._read_lines)
        self._reader.start()
        self.reports: list[list[str]] = []

    def _read_lines(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line.split())

    def _send_line(self, *words: str) -> None:
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
        self._send_line(kind, topic, type_name, reliability, durability, user_data)

    def send(self, topic: str, data: bytes) -> None:
        """Write CDR with its encapsulation header."""
        self._send_line("send", topic, data.hex())

    def has_reported(self, *words: str) -> bool:
        """Whether the peer has reported a line that begins with these words."""
        while not self._lines.empty():
            self.reports.append(self._lines.get())
        return any(line[: len(words)] == list(words) for line in self.reports)

    def samples(self, topic: str) -> list[bytes]:
        """The samples that the peer has read on a topic so far."""
        self.has_reported()
        return [bytes.fromhex(line[2]) for line in self.reports if line[:2] == ["sample", topic]]

    def close(self) -> None:
        """End the process; it leaves the DDS domain properly."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        try:
            self._process.wait(10)
        finally:
            self._process.kill()
            self._process.wait()
            self._reader.join()
            self._process.stdout.close()


@pytest.fixture
def peer(peer_program: Path, domain_id: int) -> Iterator[FastPeer]:
    """A Fast DDS peer in the test's domain."""
    peer = FastPeer(peer_program, domain_id)
    yield peer
    peer.close()


@pytest.fixture(scope="module")
def start_peer(module_domain_id: int) -> Iterator[StartPeer]:
    """Starts processes in a domain of the module; they end after the module."""
    domain = {"ROS_DOMAIN_ID": str(module_domain_id)}
    with ExitStack() as stack:
        yield lambda rclpy, name="": stack.enter_context(PeerProcess(rclpy, domain, name))


@pytest.fixture(scope="module")
def peer_on(start_peer: StartPeer) -> PeerOn:
    """One process of the module for each rclpy, started on first use."""
    return cache(start_peer)


@pytest.fixture
def topic() -> str:
    """The name of a topic that no other test uses."""
    return f"/interop/topic_{next(NUMBERS)}"
