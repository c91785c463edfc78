"""The one switch of the operator: on the pages, at the terminal and in the scenario.

A press takes the switch, on a page or at the terminal; a release at the terminal releases it everywhere. Of
two pages the first one keeps it. From the first press on, the scenario does not hold the switch any more.

Each hand sends its own heartbeats while it lives. It takes the switch by setting the parameter ``pressed`` of
the dead man's switch to false, and lets go when another hand sets it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import reactivex as rx
from reactivex import Observable

from deploy.operator import hold
from deploy.operator.remote import ParameterChange, RemoteParameters
from reactive_node import ReactiveNode

ECHO = 1.0  # s after an answer within which the event of the same change comes
VIRTUAL_SWITCH = "dead_mans_switch"
PRESSED = "pressed"


class Switch:
    """The switch, as observables; nothing happens before they are observed."""

    def __init__(
        self,
        node: ReactiveNode,
        events: Observable[hold.Event],
        changes: Observable[ParameterChange],
        is_open: Observable[bool],
        now: Callable[[], float],
    ) -> None:
        """:param changes: the parameters that are set while a page is open.
        :param now: the clock of the nonces [s].
        """
        virtual = VirtualSwitch(node, now)
        by_others = virtual.by_others(changes).share()
        releases = by_others.map(lambda _: hold.Release())
        self.holds: Observable[hold.Hold] = hold.holds(rx.merge(events, releases), now).share()
        """The switch of the pages, after each event."""
        presses = rx.merge(self.holds.filter(lambda it: it.pressed), by_others.filter(bool))
        taken = presses.switch_map(
            lambda it: virtual.take().retry() if isinstance(it, hold.Hold) else rx.never()
        )
        asked = is_open.filter(bool).switch_map(lambda _: virtual.is_pressed())
        self.pressed: Observable[bool] = rx.merge(asked, by_others, taken)
        """Whether the virtual switch was pressed by hand."""


class VirtualSwitch:
    """The dead man's switch, which the scenario holds, and whose parameter ``pressed`` all hands set."""

    def __init__(self, node: ReactiveNode, now: Callable[[], float]) -> None:
        """:param now: a clock that nobody sets [s]."""
        self._now = now
        self._parameters = RemoteParameters(node, VIRTUAL_SWITCH)
        self._echo_until = -math.inf

    def is_pressed(self) -> Observable[bool]:
        """Emit whether it was pressed by hand; nothing without an answer."""
        return self._parameters.get(PRESSED).map(bool).catch(rx.empty())

    def by_others(self, changes: Observable[ParameterChange]) -> Observable[bool]:
        """Emit what other hands set, without the changes by :meth:`take`."""
        values = changes.filter(lambda it: (it.program, it.name) == (VIRTUAL_SWITCH, PRESSED)).map(
            lambda it: it.value
        )
        return values.filter(lambda pressed: pressed or not self._is_echo())

    def _is_echo(self) -> bool:
        is_echo = self._now() <= self._echo_until
        self._echo_until = -math.inf
        return is_echo

    def take(self) -> Observable[bool]:
        """Release the switch by hand, so that it follows no scenario any more; emits ``False`` when done.

        Without an answer it ends in a TimeoutError: a dead man's switch that is killed comes back.
        """

        def begin(_: Any) -> Observable[bool]:
            self._echo_until = math.inf
            return self._parameters.set(PRESSED, False).map(done)

        def done(_: str) -> bool:
            self._echo_until = min(self._echo_until, self._now() + ECHO)
            return False

        return rx.defer(begin)
