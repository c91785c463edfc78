"""The operator's terminal: shows what the arm does, and obeys typed commands."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta
from types import TracebackType
from typing import Any

import reactivex as rx
from diagnostic_msgs.msg import KeyValue
from rclpy.qos import QoSProfile
from reactivex import Observable
from reactivex.subject import Subject
from std_msgs.msg import String

from deploy.operator import state_line
from deploy.operator.fleet import Arm
from deploy.operator.hand import BEAT_PERIOD, INPUT_ENDED, Hand
from deploy.operator.lines import BURST, Allowance, Kind, Line, line_batches
from deploy.operator.output import say
from deploy.operator.strikes import new_watchdogs
from deploy.operator.terminal.display import open_display
from interfaces import topics
from interfaces.plain_text import plain
from interfaces.service.reading import observe
from reactive_node import ReactiveNode, stamps

PERIOD = 0.25  # s between two batches of lines
BACKLOG = 50  # messages of a topic that wait for the next batch
AGAIN = 1.0  # s until `turn_off` is repeated, if the engines have not obeyed

HELP = f"""\
Commands: press, release (the operator's switch), turn_on, turn_off (the engines), quit.
Lines that come too fast are thinned to one a second of each kind. Speed is {topics.EFFECTOR_SPEED.name}."""


class Terminal:
    """The terminal of a node, open in a ``with``. It shows batches: to spin less saves most of the work."""

    def __init__(self, node: ReactiveNode, epoch: float, *, is_new: bool = False) -> None:
        """:param epoch: the origin of the lines' times [s, monotonic clock].
        :param is_new: whether the arm has just started.
        """
        self.has_quit = False
        self._node = node
        self._engines, self._senders = (
            node.create_publisher(topic.type, topic.name, topic.qos)
            for topic in (topics.ENGINES, topics.ENGINES_SENDER)
        )
        self._dropped = Allowance(BURST)
        self._hand = Hand(node, self._report, self._drop)
        self._commands: dict[str, Callable[[], None]] = {
            "press": self._hand.press,
            "release": self._hand.release,
            "turn_on": lambda: self._command_engines(topics.TURN_ON),
            "turn_off": lambda: self._command_engines(topics.TURN_OFF),
            "quit": self._quit,
        }
        self._origin = stamps.now() - timedelta(seconds=time.monotonic() - epoch)
        self._turned_off: Subject[datetime] = Subject()
        self._topics = {topic.name: self._observed(topic) for topic in topics.CONTRACT}
        again = self._turned_off.switch_map(lambda sent: rx.timer(AGAIN).take_until(self._settled(sent)))
        again.subscribe(lambda _: self._command_engines(topics.TURN_OFF), scheduler=node.scheduler)
        self._ticks: Subject[None] = Subject()
        batches = line_batches(self._seen, self._ticks, node.get_namespace())
        batches.subscribe(self._show, scheduler=node.scheduler)
        self._state = state_line.Shown(Arm(node.get_namespace(), 0))
        watchdogs = new_watchdogs(node, first_is_new=is_new)
        states = state_line.shown(node.get_namespace(), self._values, watchdogs)
        states.subscribe(self._note, scheduler=node.scheduler)

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
        width = shutil.get_terminal_size().columns - 1  # in the last column, some terminals begin a new line
        self._display.show_state(state_line.parts(self._state, time.monotonic(), width))
        due = time.monotonic() + PERIOD
        typed: list[str] = []
        try:
            while not typed and (left := due - time.monotonic()) > 0.0:
                self._hand.beat()
                typed = self._display.read(min(left, BEAT_PERIOD) if self._hand.holds else left)
        except EOFError:
            self._quit()
        if not (typed or self._display.takes_input):
            self._hand.end(INPUT_ENDED)
        for line in typed:
            if word := line.strip().lower():
                self._obey(word)

    def _observed(self, topic: topics.Topic) -> Observable[Any]:
        # A service wants the last message, the operator all of them.
        qos = QoSProfile(depth=BACKLOG, reliability=topic.qos.reliability, durability=topic.qos.durability)
        return observe(self._node, replace(topic, qos=qos), self._drop, timestamped=True)

    def _seen(self, topic: topics.Topic) -> Observable[Any]:
        return self._topics[topic.name]

    def _values(self, topic: topics.Topic) -> Observable[Any]:
        return self._seen(topic).map(lambda it: it.value)

    def _note(self, state: state_line.Shown) -> None:
        self._state = state

    def _show(self, lines: list[Line]) -> None:
        self._display.show(f"[{self._milliseconds(line):.0f}] {plain(line.text)}" for line in lines)

    def _report(self, text: str) -> None:
        self._show([Line(stamps.now(), Kind.HAND, text)])

    def _drop(self, topic: str, reason: str) -> None:
        """Show what is wrong with a message, at most once a second after a burst."""
        if self._dropped.covers(stamps.now()):
            self._report(f"Dropped from {topic}: {reason}")

    def _milliseconds(self, line: Line) -> float:
        return (line.time - self._origin) / timedelta(milliseconds=1)

    def _obey(self, word: str) -> None:
        meant = [command for command in self._commands if command.startswith(word)]
        if len(meant) == 1:
            self._commands[meant[0]]()
        else:
            say(f"{word}? Commands: {', '.join(self._commands)}")

    def _settled(self, sent: datetime) -> Observable[Any]:
        """Emit when the engines are off after a `turn_off`, or somebody wants them on again."""
        off = self._seen(topics.ENGINES_STATE).filter(lambda it: it.value == topics.OFF)
        wanted_on = self._seen(topics.ENGINES).filter(lambda it: it.value == topics.TURN_ON)
        return rx.merge(off, wanted_on).filter(lambda it: it.timestamp >= sent)

    def _command_engines(self, command: str) -> None:
        before = stamps.now()
        self._engines.publish(String(data=command))
        self._senders.publish(KeyValue(key=command, value=self._node.get_name()))
        if command == topics.TURN_OFF:
            self._turned_off.on_next(before)

    def _quit(self) -> None:
        self.has_quit = True
