"""The operator's terminal: prints what the arm does, and takes commands."""

from __future__ import annotations

import os
import select
import sys
import time
from collections.abc import Callable
from datetime import timedelta
from typing import Any

from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile
from reactivex import Observable
from std_msgs.msg import String

from deploy.console import view
from deploy.console.output import say
from interfaces import topics
from reactive_node import ReactiveNode, stamps

BACKLOG = 50  # messages of a topic that wait for the terminal

HELP = """\
Type press or release (the operator's switch), turn_on or turn_off (the engines), or quit, and Enter.
Of lines that come faster than one can read them, one a second of each kind is shown."""


class Console:
    """A node beside the system: its lines go to standard output, its commands come from standard input."""

    def __init__(self, node: ReactiveNode, epoch: float) -> None:
        """:param epoch: what the lines' times count from [s, monotonic clock]"""
        self.has_quit = False
        self._node = node
        self._input: int | None = 0
        self._typed = b""
        self._engines = node.create_publisher(String, topics.ENGINES.name, topics.ENGINES.qos)
        self._switch = AsyncParameterClient(node, "dead_mans_switch")
        self._commands: dict[str, Callable[[], None]] = {
            "press": lambda: self._hold_switch(True),
            "release": lambda: self._hold_switch(False),
            "turn_on": lambda: self._engines.publish(String(data=topics.TURN_ON)),
            "turn_off": lambda: self._engines.publish(String(data=topics.TURN_OFF)),
            "quit": self._quit,
        }
        elapsed = time.monotonic() - epoch
        self._origin = stamps.now() - timedelta(seconds=elapsed)
        lines = view.view(self._seen, max(0.0, -elapsed), node.get_namespace())
        lines.subscribe(self._show, scheduler=node.scheduler)

    def read_commands(self) -> None:
        """Do what was typed since; never waits for input."""
        if self._input is None or not select.select([self._input], [], [], 0)[0]:
            return
        try:
            typed = os.read(self._input, 1024)
        except OSError:  # the terminal belongs to another job now
            return
        if not typed:
            self._input = None
            if sys.stdin.isatty():  # Ctrl-D; the end of a file or a pipe means nothing
                self._quit()
            return
        *lines, self._typed = (self._typed + typed).split(b"\n")
        for line in lines:
            if word := line.decode(errors="replace").strip().lower():
                self._obey(word)

    def _seen(self, topic: topics.Topic) -> Observable[Any]:
        # A service wants the last message, the operator all of them: the terminal may be slow for a moment.
        qos = QoSProfile(depth=BACKLOG, reliability=topic.qos.reliability, durability=topic.qos.durability)
        return self._node.create_observable(topic.type, topic.name, qos, timestamped=True)

    def _show(self, line: view.Line) -> None:
        milliseconds = (line.time - self._origin) / timedelta(milliseconds=1)
        say(f"[{milliseconds:.0f}] {line.text}")

    def _obey(self, word: str) -> None:
        meant = [command for command in self._commands if command.startswith(word)]
        if len(meant) == 1:
            self._commands[meant[0]]()
        else:
            say(f"{word}? Commands: {', '.join(self._commands)}")

    def _hold_switch(self, pressed: bool) -> None:
        if not self._switch.services_are_ready():
            say("dead_mans_switch is not there")
            return
        self._switch.set_parameters([Parameter("pressed", value=pressed)])

    def _quit(self) -> None:
        self.has_quit = True
