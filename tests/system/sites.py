"""Whole systems as a user runs them: run directories, commands, terminals, and a node that observes."""

from __future__ import annotations

import configparser
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher

from deploy.supervision import manifest, processes
from deploy.supervision.processes import ROOT
from deploy.supervision.system import System
from interfaces import topics
from tests.environment import user_environment

LIMIT = 30.0  # s for each awaited event, even on a busy machine
LOOK = 0.1  # s between two looks at all processes, which cost some milliseconds
STEADY = str(Path(__file__).with_name("steady.yaml"))
SMALL = ("dead_mans_switch", "engine_controller", "sentinel")
"""The programs of a small arm: enough to start and stop, and for the operator's terminal."""


class Command:
    """A command with its input and its output so far: lines, each with its time [s]."""

    def __init__(self, arguments: list[str], environment: dict[str, str], directory: Path) -> None:
        self.lines: list[tuple[float, str]] = []
        self._changed = threading.Condition()
        self._process = subprocess.Popen(
            arguments,
            cwd=directory,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            text=True,
            bufsize=1,
        )
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    @property
    def output(self) -> str:
        return "\n".join(text for _, text in self.lines)

    def await_line(self, pattern: str, seconds: float = LIMIT, after: int = 0) -> re.Match[str]:
        """The first line with this pattern, as soon as it appears; the first ``after`` lines do not count."""
        found = self._find(pattern, seconds, after)
        assert found is not None, f"no {pattern!r} within {seconds} s:\n{self.output}"
        return found

    def _find(self, pattern: str, seconds: float, after: int = 0) -> re.Match[str] | None:
        found: re.Match[str] | None = None

        def is_there() -> bool:
            nonlocal found
            found = next(
                (match for _, text in self.lines[after:] if (match := re.search(pattern, text))), None
            )
            return found is not None

        with self._changed:
            self._changed.wait_for(is_there, seconds)
        return found

    def type(self, text: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(text)
        self._process.stdin.flush()

    def insist(self, text: str, pattern: str) -> None:
        """Type until a line shows the effect: a node that was discovered just now may miss the first."""
        deadline = time.monotonic() + LIMIT
        self.type(text)
        while not self._find(pattern, 2.0):
            assert time.monotonic() < deadline, f"no {pattern!r}:\n{self.output}"
            self.type(text)

    def signal(self, number: int) -> None:
        os.killpg(self._process.pid, number)

    def wait(self, seconds: float = LIMIT) -> int:
        try:
            code = self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            pytest.fail(f"has not ended within {seconds} s:\n{self.output}")
        self._reader.join()
        return code

    def close(self) -> None:
        if self._process.poll() is None:
            self.signal(signal.SIGKILL)
        self._process.wait()
        self._reader.join()
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(BrokenPipeError):  # it has ended without reading its input
            self._process.stdin.close()
        self._process.stdout.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with self._changed:
                self.lines.append((time.monotonic(), line.rstrip("\r\n")))
                self._changed.notify_all()


class Site:
    """A run directory, a DDS domain and a ROS namespace for one system of a checkout."""

    def __init__(self, run: Path, domain: int, namespace: str = "", directory: Path = ROOT) -> None:
        self.run = run
        self.domain = domain
        self.namespace = namespace
        self.directory = directory
        self.python = sys.executable if directory == ROOT else str(directory / ".venv" / "bin" / "python")
        self.commands = ExitStack()

    @property
    def environment(self) -> dict[str, str]:
        """The variables that a user sets for a second system next to the usual one."""
        return user_environment() | {
            "REACTIVE_ARM_RUN_DIR": str(self.run),
            "REACTIVE_ARM_NAMESPACE": self.namespace,
            "ROS_DOMAIN_ID": str(self.domain),
        }

    def begin(self, *arguments: str) -> Command:
        """Begin a command of `make`, without make."""
        return self._begin(self.command(arguments))

    def begin_command(self, *command: str) -> Command:
        return self._begin(list(command))

    def begin_alone(self, command: list[str], environment: dict[str, str]) -> Command:
        """Begin any command with nothing but this environment."""
        begun = Command(command, environment, self.directory)
        self.commands.callback(begun.close)
        return begun

    def begin_in_terminal(self, *command: str) -> Command:
        """Begin any command in a terminal of its own, which closes when the returned command is killed."""
        spawn = [sys.executable, "-c", "import pty, sys; pty.spawn(sys.argv[1:])"]
        return self._begin([*spawn, *command], TERM="xterm")

    def _begin(self, command: list[str], **environment: str) -> Command:
        return self.begin_alone(command, self.environment | environment)

    def do(self, *arguments: str) -> tuple[int, str]:
        """Do a command of `make`, without make: its exit code and its output."""
        return self.do_command(*self.command(arguments))

    def command(self, arguments: tuple[str, ...]) -> list[str]:
        """The command behind `make`; `make stop` needs no .venv."""
        if arguments == ("stop",):
            return [sys._base_executable, "-m", "deploy.commands.stop"]  # type: ignore[attr-defined]
        return [self.python, "-m", "deploy.commands.launcher", *arguments]

    def do_command(self, *command: str) -> tuple[int, str]:
        """Do any command: its exit code and its output."""
        done = subprocess.run(
            command,
            cwd=self.directory,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=2 * LIMIT,
        )
        return done.returncode, done.stdout.strip()

    @property
    def members(self) -> dict[str, int]:
        """The pids of the live processes of the system, by program; that of supervisord by ''."""
        return {process.program: process.pid for process in processes.of_system(self.run)}

    @property
    def programs(self) -> set[str]:
        """The programs of the system; each has a process while it runs."""
        return {each.name for each in manifest.programs(self.directory / "deploy" / "supervisord.conf")}

    def await_members(self, condition: Callable[[dict[str, int]], bool]) -> None:
        deadline = time.monotonic() + LIMIT
        while not condition(self.members):
            assert time.monotonic() < deadline, f"{self.members} after {LIMIT} s"
            time.sleep(LOOK)

    def close(self) -> None:
        try:
            self.commands.close()
        finally:
            System(self.run).stop()


class Checkout(Site):
    """A site as in a user's checkout: its run directory is .run, and .venv/bin is on the PATH."""

    def __init__(self, directory: Path, domain: int) -> None:
        super().__init__(directory / ".run", domain, directory=directory)

    @property
    def environment(self) -> dict[str, str]:
        path = f"{self.directory / '.venv' / 'bin'}{os.pathsep}{os.environ['PATH']}"
        return user_environment() | {"ROS_DOMAIN_ID": str(self.domain), "PATH": path}

    def close(self) -> None:
        """End all commands and the system; its files must not meet the next test."""
        super().close()
        shutil.rmtree(self.run, ignore_errors=True)


def make_small_arm(parent: Path, programs: Sequence[str] = SMALL) -> Path:
    """Make a checkout of a small arm, set up, in a directory whose path is as unpleasant as paths get."""
    directory = parent / 'it\'s 100 % "fine"' / ("deep" * 30)
    ignored = shutil.ignore_patterns("runtime", "tools", "tests", "*.pyc.*")  # the last are gone in a moment
    for name in ("deploy", "interfaces", "services"):
        shutil.copytree(ROOT / name, directory / name, ignore=ignored)
    for name in ("runtime", "tools"):
        (directory / "deploy" / name).symlink_to(ROOT / "deploy" / name)
    shutil.copyfile(ROOT / "Makefile", directory / "Makefile")
    _leave_programs(directory / "deploy" / "supervisord.conf", programs)
    _set_up(directory)
    return directory


def _leave_programs(path: Path, names: Sequence[str]) -> None:
    conf = configparser.RawConfigParser(inline_comment_prefixes=(" ;",))
    conf.read(path)
    for section in conf.sections():
        kind, _, name = section.partition(":")
        if kind == "program" and name not in names:
            conf.remove_section(section)
    conf[f"group:{manifest.GROUP}"]["programs"] = ", ".join(names)
    with path.open("w") as file:
        conf.write(file)


def _set_up(directory: Path) -> None:
    """Give a checkout our packages in a .venv of its own, with the stamp of a set-up."""
    venv = directory / ".venv"
    venv.mkdir()
    for entry in Path(sys.prefix).iterdir():
        if entry.name != "made-from":
            (venv / entry.name).symlink_to(entry)
    stamp = "from deploy.commands import setup; setup.make = lambda *_: None; setup.main()"
    base: str = sys._base_executable  # type: ignore[attr-defined]
    subprocess.run([base, "-c", stamp], cwd=directory, check=True, stdout=subprocess.DEVNULL)


class Peer:
    def __init__(self, domain: int, name: str = "peer") -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self.node = Node(name, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)

    def collect(self, topic: topics.Topic) -> list[Any]:
        """The list of messages on a topic from now on, and of latched ones."""
        messages: list[Any] = []
        self.node.create_subscription(topic.type, topic.name, messages.append, topic.qos)
        return messages

    def publisher(self, topic: topics.Topic) -> Publisher:
        return self.node.create_publisher(topic.type, topic.name, topic.qos)

    def spin_until(self, condition: Callable[[], object], seconds: float = LIMIT) -> None:
        deadline = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < deadline, f"not within {seconds} s"
            self.spin_once(0.1)

    def spin_once(self, seconds: float) -> None:
        self._executor.spin_once(timeout_sec=seconds)

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()
