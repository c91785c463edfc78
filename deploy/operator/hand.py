"""The operator's hand at a terminal: it holds the switch from `press` on, as long as the terminal lives.

The terminal itself sends the heartbeats. A terminal that is killed, stopped or hung is a silent operator, and
the death of the virtual switch releases nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.publisher import Publisher
from reactivex import Observable
from reactivex.subject import Subject
from std_msgs.msg import Bool

from deploy.operator import hold
from deploy.operator.output import say
from deploy.operator.remote import parameter_changes
from deploy.operator.switch import VIRTUAL_SWITCH, VirtualSwitch
from interfaces.topics import OPERATOR_HEARTBEAT
from reactive_node import ReactiveNode

BEAT_PERIOD = 0.05  # s
LONGEST_PAUSE = 1.0  # s between two beats; after a longer one the hand has to press again
NAME = "terminal"
TAKEN = "Another hand has taken or released the switch."
PAUSED = "Released: {}, because this terminal stood still. Press again."


class Hand:
    def __init__(self, node: ReactiveNode, tell: Callable[[str], None] = say) -> None:
        """:param tell: tells the user what becomes of the hand."""
        self._node = node
        self._tell = tell
        self._publisher: Publisher | None = None  # exists while the hand holds: so pages know who holds
        self._events: Subject[hold.Event] = Subject()
        self._takes: Subject[None] = Subject()
        holds = hold.holds(self._events, hold.monotonic, LONGEST_PAUSE)
        holds.subscribe(self._follow, scheduler=node.scheduler)
        switch = VirtualSwitch(node, hold.monotonic)
        others = switch.by_others(parameter_changes(node))
        others.subscribe(self._give_way, scheduler=node.scheduler)
        self._takes.switch_map(lambda _: self._insist(switch.take())).subscribe(scheduler=node.scheduler)

    @property
    def holds(self) -> bool:
        return self._publisher is not None

    def press(self) -> None:
        """Hold the switch, and take it from all other hands and the scenario."""
        self._events.on_next(hold.Press(NAME, hold.monotonic()))
        self._takes.on_next(None)

    def release(self) -> None:
        """Release the switch, even where another hand holds it."""
        self._events.on_next(hold.Release())
        self._takes.on_next(None)

    def beat(self) -> None:
        """Give a sign of life, if the hand holds; to be called every ``BEAT_PERIOD``."""
        if self.holds:
            self._events.on_next(hold.Beat(NAME, hold.monotonic()))

    def _give_way(self, _: bool) -> None:
        if self.holds:
            self._tell(TAKEN)
            self._events.on_next(hold.Release())

    def _follow(self, state: hold.Hold) -> None:
        if state.alive:
            topic = OPERATOR_HEARTBEAT
            self._publisher = self._publisher or self._node.create_publisher(
                topic.type, topic.name, topic.qos
            )
            self._publisher.publish(Bool(data=True))
        elif self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
            self._publisher = None
            if state.ended:
                self._tell(PAUSED.format(state.ended[1]))

    def _insist(self, attempt: Observable[bool]) -> Observable[bool]:
        """Try until the virtual switch answers: a process that is killed loses the request."""

        def again(error: Exception, _: Any) -> Observable[bool]:
            self._tell(f"{VIRTUAL_SWITCH} does not answer: trying again until it does")
            return attempt.retry()

        return attempt.catch(again)
