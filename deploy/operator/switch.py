"""The one switch of the operator: on the pages, at the terminal and in the scenario.

A press takes the switch, on a page or at the terminal; a release at the terminal releases it everywhere. Of
two pages the first one keeps it. From the first press on, the scenario does not hold the switch any more.

Each hand sends its own heartbeats while it lives. It takes the switch by setting the parameter ``pressed`` of
the dead man's switch to false, together with ``hand``, its own name. It lets go when another hand sets it.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable

import reactivex as rx
from reactivex import Observable

from deploy.operator import hold
from deploy.operator.remote import ParameterChange, RemoteParameters
from reactive_node import ReactiveNode

VIRTUAL_SWITCH = "dead_mans_switch"
PRESSED, HAND = "pressed", "hand"


class Switch:
    """The switch, as observables; nothing happens before they are observed."""

    def __init__(
        self,
        node: ReactiveNode,
        events: Observable[hold.Event],
        changes: Observable[ParameterChange],
        now: Callable[[], float],
    ) -> None:
        """:param changes: the parameters that are set while a page is open.
        :param now: the clock of the nonces [s].
        """
        virtual = VirtualSwitch(node)
        by_others = virtual.by_others(changes).share()
        releases = by_others.map(lambda _: hold.Release())
        holds = hold.holds(rx.merge(events, releases), now).share()
        presses = holds.filter(lambda it: it.pressed)
        # Another hand ends a take that has no answer yet: its hold is the newer one.
        taken = presses.switch_map(lambda _: virtual.take().retry().take_until(by_others))
        self.holds: Observable[hold.Hold] = rx.merge(holds, taken.ignore_elements()).share()
        """The switch of the pages, after each event."""


class VirtualSwitch:
    """The dead man's switch, which the scenario holds, and whose parameter ``pressed`` all hands set."""

    def __init__(self, node: ReactiveNode) -> None:
        # Terminals on two hosts may have one name, which ends in a pid: those of containers are often alike.
        self._hand = f"{node.get_name()} {secrets.token_hex(4)}"
        self._parameters = RemoteParameters(node, VIRTUAL_SWITCH)

    def by_others(self, changes: Observable[ParameterChange]) -> Observable[ParameterChange]:
        """Emit what other hands set."""
        of_switch = changes.filter(lambda it: (it.program, it.name) == (VIRTUAL_SWITCH, PRESSED))
        return of_switch.filter(lambda it: it.together.get(HAND) != self._hand)

    def take(self) -> Observable[str]:
        """Release the switch by hand, so that it follows no scenario any more; emits why that fails, or "".

        Without an answer it ends in a TimeoutError: a dead man's switch that is killed comes back.
        """
        return self._parameters.set_together({PRESSED: False, HAND: self._hand})
