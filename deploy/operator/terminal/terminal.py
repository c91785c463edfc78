"""The operator's terminal: shows what the arm does, and obeys typed commands."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import timedelta
from types import TracebackType
from typing import Any

import reactivex as rx
from rclpy.qos import QoSProfile
from reactivex import Observable
from reactivex.subject import Subject
from std_msgs.msg import String

from deploy.operator.engines import graph
from deploy.operator.hand import BEAT_PERIOD, Hand
from deploy.operator.lines import Kind, Line, Span, line_batches
from deploy.operator.output import say
from deploy.operator.terminal.display import open_display
from interfaces import topics
from reactive_node import ReactiveNode, stamps
from reactive_node.stamps import Timestamp

PERIOD = 0.25  # s between two batches of lines
BACKLOG = 50  # messages of a topic that wait for the next batch
AGAIN = 1.0  # s until `turn_off` is repeated, if the engines have not obeyed

HELP = """\
Commands: press, release (the operator's switch), turn_on, turn_off (the engines), quit.
Lines that come too fast to be read are thinned to one a second of each kind."""


class Terminal:
    """The terminal of a node, open in a ``with``. It shows batches: to spin less saves most of the work."""

    def __init__(self, node: ReactiveNode, epoch: float, *, attached: bool = False) -> None:
        """:param epoch: the origin of the lines' times [s, monotonic clock].
        :param attached: whether it begins later than the arm.
        """
        self.has_quit = False
        self._node = node
        self._engines = node.create_publisher(String, topics.ENGINES.name, topics.ENGINES.qos)
        self._hand = Hand(node, self._tell)
        self._commands: dict[str, Callable[[], None]] = {
            "press": self._hand.press,
            "release": self._hand.release,
            "turn_on": lambda: self._command_engines(topics.TURN_ON),
            "turn_off": lambda: self._command_engines(topics.TURN_OFF),
            "quit": self._quit,
        }
        self._origin = stamps.now() - timedelta(seconds=time.monotonic() - epoch)
        self._turned_off: Subject[Span] = Subject()
        self._topics = {topic.name: self._observed(topic) for topic in topics.CONTRACT}
        again = self._turned_off.switch_map(lambda span: rx.timer(AGAIN).take_until(self._settled(span)))
        again.subscribe(lambda _: self._command_engines(topics.TURN_OFF), scheduler=node.scheduler)
        self._ticks: Subject[None] = Subject()
        batches = line_batches(
            self._seen, self._turned_off, self._ticks, graph(node), node.get_namespace(), attached=attached
        )
        batches.subscribe(self._show, scheduler=node.scheduler)

    def __enter__(self) -> Terminal:
        self._display = open_display(list(self._commands))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._display.close()

    def refresh(self) -> None:
        """Show the lines that have come, and obey what is typed until the next batch is due."""
        self._ticks.on_next(None)
        due = time.monotonic() + PERIOD
        typed: list[str] = []
        try:
            while not typed and (left := due - time.monotonic()) > 0.0:
                self._hand.beat()
                typed = self._display.read(min(left, BEAT_PERIOD) if self._hand.holds else left)
        except EOFError:
            self._quit()
        for line in typed:
            if word := line.strip().lower():
                self._obey(word)

    def _observed(self, topic: topics.Topic) -> Observable[Any]:
        # A service wants the last message, the operator all of them.
        def valued(received: Timestamp[Any]) -> Timestamp[Any]:
            return received._replace(value=topic.value(received.value))

        qos = QoSProfile(depth=BACKLOG, reliability=topic.qos.reliability, durability=topic.qos.durability)
        return self._node.create_observable(topic.type, topic.name, qos, timestamped=True, item=valued)

    def _seen(self, topic: topics.Topic) -> Observable[Any]:
        return self._topics[topic.name]

    def _show(self, lines: list[Line]) -> None:
        self._display.show(f"[{self._milliseconds(line):.0f}] {line.text}" for line in lines)

    def _tell(self, text: str) -> None:
        self._show([Line(stamps.now(), Kind.HAND, text)])

    def _milliseconds(self, line: Line) -> float:
        return (line.time - self._origin) / timedelta(milliseconds=1)

    def _obey(self, word: str) -> None:
        meant = [command for command in self._commands if command.startswith(word)]
        if len(meant) == 1:
            self._commands[meant[0]]()
        else:
            say(f"{word}? Commands: {', '.join(self._commands)}")

    def _settled(self, sent: Span) -> Observable[Any]:
        """Emit when the engines are off after a `turn_off`, or somebody wants them on again."""
        off = self._seen(topics.ENGINES_STATE).filter(lambda it: it.value == topics.OFF)
        wanted_on = self._seen(topics.ENGINES).filter(lambda it: it.value == topics.TURN_ON)
        return rx.merge(off, wanted_on).filter(lambda it: it.timestamp >= sent[0])

    def _command_engines(self, command: str) -> None:
        before = stamps.now()
        self._engines.publish(String(data=command))
        if command == topics.TURN_OFF:
            self._turned_off.on_next((before, stamps.now()))

    def _quit(self) -> None:
        self.has_quit = True
