"""Why the engines are off, as far as topics and graph tell: for the page and the terminal."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from deploy.supervision import manifest
from interfaces import topics
from interfaces.topics import ON
from reactive_node import ReactiveNode

WATCHDOG = "operator_watchdog"
TOGETHER = 1.0  # s within which a command or a conclusion explains that the engines are off
EARLY = 0.3  # s that a command may be older by the sender's health than by its arrival
REPORTED = 2.0  # s within which each service that sent a command has told so
RENEWED = 0.5  # s: the drive's 0.4 s and the way of the message

BY_WATCHDOG = "turned off by operator_watchdog (operator incapacitated)"
BY_PAGE = "turned off on a page"
BY_COMMAND = "turned off by a command of another node"
BY_NODE = "turned off by {}"
BY_CONTROLLER = "turned off by engine_controller (no operator seen in time)"
RESTARTED = "turned off as engine_controller was killed or stopped"
NOT_YET = "not turned on yet"
OLDER = "off since before the page was served"


class Graph(NamedTuple):
    """Who is present."""

    controllers: Callable[[], frozenset[Any]]
    """Returns the publishers of the engines' state."""
    strangers: Callable[[], set[str]]
    """Returns the nodes that may command the engines and report no health, such as a terminal."""


def graph(node: ReactiveNode) -> Graph:
    """Return the others that a node sees."""
    states, commands = (node.resolve_topic_name(each.name) for each in (topics.ENGINES_STATE, topics.ENGINES))
    known = {program.name for program in manifest.everywhere()} | {node.get_name()}
    return Graph(
        lambda: frozenset(tuple(it.endpoint_gid) for it in node.get_publishers_info_by_topic(states)),
        lambda: {it.node_name for it in node.get_publishers_info_by_topic(commands)} - known,
    )


class Engines(NamedTuple):
    state: str | None = None
    reported: float = -math.inf
    """When the state was published."""
    controllers: frozenset[Any] = frozenset()
    """The publishers of the state when they went on."""
    off_since: float = -math.inf
    off_at: float | None = None
    """The same, since the origin of the scenario; ``None`` if it is not known."""
    since_when: str = NOT_YET
    """Why they are off, if no command explains it."""
    cause: str = ""
    """The command or conclusion that has turned them off."""
    caused: float = -math.inf
    strangers: tuple[str, ...] = ()
    """The nodes without health that may have sent that command."""
    own_turn_off: float = -math.inf
    """When a page has turned them off."""
    refused: tuple[float, str] | None = None
    """When and why a `turn_on` was refused."""

    def report(self, state: str, now: float, controllers: Callable[[], frozenset[Any]]) -> Engines:
        """Note their state at a time [s]."""
        was_on = self.state == ON
        after = self._replace(state=state, reported=now)
        if state == ON:
            # A repeated `on` may come after the command that ends it.
            cause = self.cause if was_on and now - self.caused < TOGETHER else ""
            known = self.controllers if was_on else controllers()
            return after._replace(controllers=known, cause=cause, refused=None)
        if was_on:
            is_restarted = now - self.reported >= RENEWED or not controllers() <= self.controllers
            return after._replace(off_since=now, since_when=RESTARTED if is_restarted else BY_CONTROLLER)
        return after

    def explain(self, cause: str, now: float) -> Engines:
        """Note why they go off: messages of other topics may come a little before or after that."""
        goes_off = self.state == ON or now - self.off_since < TOGETHER
        is_older = self.off_since == -math.inf and self.since_when == OLDER
        # The command of the watchdog may overtake its conclusion.
        is_first = not self.cause or (self.cause == BY_COMMAND and now - self.caused < TOGETHER)
        return self._replace(cause=cause, caused=now) if (goes_off or is_older) and is_first else self

    def name(self, service: str, sent: float) -> Engines:
        """Note that a service sent a command `turn_off` at a time [s]."""
        if self.cause != BY_COMMAND or not self.caused - EARLY <= sent <= self.caused + TOGETHER:
            return self
        return self._replace(cause=BY_WATCHDOG if service == WATCHDOG else BY_NODE.format(service))

    def reason(self, now: float, heard_since: float) -> str:
        """Return why they are off at a time [s]; the services are heard since ``heard_since`` [s]."""
        is_nameless = now - max(self.caused, heard_since) > REPORTED
        if self.cause == BY_COMMAND and self.strangers and is_nameless:
            return BY_NODE.format(" or ".join(self.strangers))
        return self.cause or self.since_when
