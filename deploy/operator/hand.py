"""The operator's hand at a terminal: it holds the switch from `press` on, as long as the terminal lives.

The terminal itself sends the heartbeats. A terminal that is killed, stopped or hung is a silent operator, and
the death of the virtual switch releases nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from reactivex import Observable
from reactivex.subject import Subject
from std_msgs.msg import Bool

from deploy.operator import hold
from deploy.operator.output import say
from deploy.operator.remote import PARAMETER_EVENTS, parameter_changes
from deploy.operator.switch import VIRTUAL_SWITCH, VirtualSwitch
from interfaces import hand
from interfaces.service.reading import Drop, observe, unreported
from interfaces.topics import OPERATOR_HAND, OPERATOR_HEARTBEAT
from reactive_node import ReactiveNode

BEAT_PERIOD = 0.05  # s
LONGEST_PAUSE = 1.0  # s between two beats; after a longer one the hand has to press again
NAME = "terminal"
INPUT_ENDED = "Released: the input of this terminal has ended, so nobody could release here."
TAKEN = "Another hand has taken or released the switch."
PAUSED = "Released: {}, because this terminal stood still. Press again."


class Hand:
    def __init__(
        self, node: ReactiveNode, report: Callable[[str], None] = say, drop: Drop = unreported
    ) -> None:
        """:param report: shows the user what becomes of the hand.
        :param drop: see :mod:`interfaces.service.reading`.
        """
        self._report = report
        self.holds = False
        self._heartbeats, self._hands = (
            node.create_publisher(topic.type, topic.name, topic.qos)
            for topic in (OPERATOR_HEARTBEAT, OPERATOR_HAND)
        )
        self._beats: Subject[None] = Subject()
        self._events: Subject[hold.Event] = Subject()
        self._takes: Subject[None] = Subject()
        headers = hand.headers(self._beats, node.get_name())
        headers.subscribe(self._hands.publish, scheduler=node.scheduler)
        holds = hold.holds(self._events, hold.monotonic, LONGEST_PAUSE)
        holds.subscribe(self._follow, scheduler=node.scheduler)
        switch = VirtualSwitch(node)
        events = observe(node, PARAMETER_EVENTS, drop)
        others = switch.by_others(parameter_changes(events, node.get_namespace()))
        others.subscribe(lambda _: self.end(TAKEN), scheduler=node.scheduler)
        self._takes.switch_map(lambda _: self._insist(switch.take())).subscribe(scheduler=node.scheduler)

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

    def end(self, why: str) -> None:
        """End the hold, if there is one, and report why."""
        if self.holds:
            self._report(why)
            self._events.on_next(hold.Release())

    def _follow(self, state: hold.Hold) -> None:
        was_held, self.holds = self.holds, state.alive
        if state.alive:
            self._heartbeats.publish(Bool(data=True))
            self._beats.on_next(None)
        elif was_held and state.ended:
            self._report(PAUSED.format(state.ended[1]))

    def _insist(self, attempt: Observable[str]) -> Observable[str]:
        """Try until the virtual switch answers: a process that is killed loses the request."""

        def again(error: Exception, _: Any) -> Observable[str]:
            self._report(f"{VIRTUAL_SWITCH} does not answer: trying again until it does")
            return attempt.retry()

        return attempt.catch(again)
