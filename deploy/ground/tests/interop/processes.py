"""Peers on each rclpy: processes that a test commands."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import Future
from importlib.metadata import PackageNotFoundError, distribution
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from deploy.ground.tests.host import RANGE, TIMEOUT

PROGRAM = Path(__file__).with_name("peer.py")
PAIRS = [("cyclonedds", "jazzy"), ("jazzy", "cyclonedds")]
"""rclpy on Cyclone DDS, and ROS 2's own in the same environment."""
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
"""Environment variable of Fast DDS 2; ROS 2 Kilted has Fast DDS 3, with other names of settings."""
DEPLOY = Path(__file__).parents[3]
WITHOUT_SHARED_MEMORY = {
    "jazzy": {
        RANGE: "SYSTEM_DEFAULT",  # the profile keeps to loopback; the range would add shared memory
        PROFILES: str(DEPLOY / "fastdds.localhost.xml"),
    }
}
"""For peers that are killed: the environment in which they leave no files in /dev/shm."""
KILTED_PYTHON = "KILTED_PYTHON"
"""Environment variable: the Python of an environment with ROS 2 Kilted's rclpy from PyPI."""


def python(rclpy: str) -> str:
    """Return the Python of ``cyclonedds``, ``jazzy`` or ``kilted``; skip the test if there is none."""
    if rclpy == "kilted":
        if KILTED_PYTHON not in os.environ:
            pytest.skip(f"platform: no rclpy of ROS 2 Kilted here: {KILTED_PYTHON} names no Python")
        return os.environ[KILTED_PYTHON]
    if rclpy == "jazzy":
        try:
            distribution("ros-rclpy")
        except PackageNotFoundError:
            pytest.skip("platform: PyPI has no rclpy of ROS 2 for this machine")
    return sys.executable


def environment(rclpy: str) -> dict[str, str]:
    """Return the environment of a node on an rclpy. It does not depend on the rclpy of the tests."""
    # A wheel starts its interpreter again with the libraries of its own environment, but only once.
    not_inherited = ("LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE", "RUNTIME", PROFILES)
    result = {name: value for name, value in os.environ.items() if name not in not_inherited}
    result |= {"RCLPY_GROUND": "cyclonedds" if rclpy == "cyclonedds" else "", RANGE: "LOCALHOST"}
    return result | ({PROFILES: str(DEPLOY / "fastdds.xml")} if rclpy == "jazzy" else {})


class PeerProcess:
    """A process with a node on an rclpy. The methods of its node (peer.py) are called by their names."""

    def __init__(
        self,
        rclpy: str,
        variables: dict[str, str],
        name: str = "",
        enter: Sequence[str] = (),
    ) -> None:
        """``name``: of the node, by default that of the rclpy; ``enter``: runs a command on another host."""
        self.name, self.namespace = name or f"{rclpy}_peer", f"/{rclpy}"
        self.full_name = f"{self.namespace}/{self.name}"
        self._process = subprocess.Popen(
            [*enter, python(rclpy), str(PROGRAM), self.name, self.namespace],
            env=environment(rclpy) | variables,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._numbers = count()
        self._waiting: dict[int, Future[Any]] = {}
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            number, result, error = json.loads(line)
            future = self._waiting.pop(number)
            if error is None:
                future.set_result(result)
            else:
                future.set_exception(RuntimeError(error))
        for future in self._waiting.values():
            future.set_exception(RuntimeError(f"{self.full_name} has ended"))

    def begin(self, method: str, *arguments: Any) -> Future[Any]:
        """Call a method of the node; return its result to come."""
        number, future = next(self._numbers), Future[Any]()
        self._waiting[number] = future
        assert self._process.stdin is not None
        print(json.dumps([number, method, arguments]), file=self._process.stdin, flush=True)
        return future

    def __call__(self, method: str, *arguments: Any) -> Any:
        """Call a method of the node; return its result."""
        return self.begin(method, *arguments).result(TIMEOUT)

    def kill(self) -> None:
        """End the process by SIGKILL: it takes no leave of the others."""
        self._process.kill()
        self._process.wait()

    def __enter__(self) -> PeerProcess:
        return self

    def __exit__(self, *_: object) -> None:
        """End the process; it takes leave of the others."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(TIMEOUT)
        finally:
            self.kill()
            self._reader.join()
            assert self._process.stdout is not None
            self._process.stdout.close()
