"""The operator's terminal: shows what the arm does, and obeys typed commands."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import timedelta
from types import TracebackType
from typing import Any

from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile
from reactivex import Observable
from reactivex.subject import Subject
from std_msgs.msg import String

from deploy.console.lines import Line, Span, line_batches
from deploy.console.output import say
from deploy.console.terminal import open_terminal
from interfaces import topics
from reactive_node import ReactiveNode, stamps

PERIOD = 0.25  # s between two batches of lines
BACKLOG = 50  # messages of a topic that wait for the next batch

HELP = """\
Commands: press, release (the operator's switch), turn_on, turn_off (the engines), quit.
Lines that come too fast to be read are thinned to one a second of each kind."""


class Console:
    """
    The terminal of a node beside the system, open in a ``with``.

    Lines are shown in batches: the node need not spin between them, which saves most of the work.
    """

    def __init__(self, node: ReactiveNode, epoch: float) -> None:
        """
        Subscribe to what is shown.

        :param epoch: the origin of the lines' times [s, monotonic clock].
        """
        self.has_quit = False
        self._node = node
        self._engines = node.create_publisher(String, topics.ENGINES.name, topics.ENGINES.qos)
        self._switch = AsyncParameterClient(node, "dead_mans_switch")
        self._commands: dict[str, Callable[[], None]] = {
            "press": lambda: self._hold_switch(True),
            "release": lambda: self._hold_switch(False),
            "turn_on": lambda: self._command_engines(topics.TURN_ON),
            "turn_off": lambda: self._command_engines(topics.TURN_OFF),
            "quit": self._quit,
        }
        self._origin = stamps.now() - timedelta(seconds=time.monotonic() - epoch)
        self._turned_off: Subject[Span] = Subject()
        self._ticks: Subject[None] = Subject()
        batches = line_batches(self._seen, self._turned_off, self._ticks, node.get_namespace())
        batches.subscribe(self._show, scheduler=node.scheduler)

    def __enter__(self) -> Console:
        self._terminal = open_terminal(list(self._commands))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._terminal.close()

    def refresh(self) -> None:
        """Show the lines that have come, and obey what is typed until the next batch is due."""
        self._ticks.on_next(None)
        try:
            for line in self._terminal.read(PERIOD):
                if word := line.strip().lower():
                    self._obey(word)
        except EOFError:
            self._quit()

    def _seen(self, topic: topics.Topic) -> Observable[Any]:
        # A service wants the last message, the operator all of them.
        qos = QoSProfile(depth=BACKLOG, reliability=topic.qos.reliability, durability=topic.qos.durability)
        return self._node.create_observable(topic.type, topic.name, qos, timestamped=True)

    def _show(self, lines: list[Line]) -> None:
        self._terminal.show(f"[{self._milliseconds(line):.0f}] {line.text}" for line in lines)

    def _milliseconds(self, line: Line) -> float:
        return (line.time - self._origin) / timedelta(milliseconds=1)

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

    def _command_engines(self, command: str) -> None:
        before = stamps.now()
        self._engines.publish(String(data=command))
        if command == topics.TURN_OFF:
            self._turned_off.on_next((before, stamps.now()))

    def _quit(self) -> None:
        self.has_quit = True
