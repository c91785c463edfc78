"""Plays the timelines of a scenario from the epoch on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import reactivex as rx
from reactivex import Observable

from interfaces.service import ServiceNode, parameter
from interfaces.service.epoch import Epoch
from interfaces.sources import playback
from interfaces.sources.scenario_file import Scenario, load
from interfaces.sources.timeline import Events, Sweep

T = TypeVar("T")


@dataclass(frozen=True)
class _Parameters:
    scenario: str = parameter("", None, "", "file of the scenario, or empty")


class Player:
    """The scenario of a node, and its timelines as observables."""

    def __init__(self, node: ServiceNode, epoch: Epoch) -> None:
        """Load the scenario that a parameter of the node names. Raises UserError if it has an error."""
        path = node.declare(_Parameters).scenario
        self.scenario = load(path) if path else Scenario()
        self._epoch = epoch

    def state(self, timeline: Events[T] | Sweep | None) -> Observable[T] | None:
        """Return the value that holds, and every change; None without a timeline."""
        if timeline is None:
            return None
        return self._epoch.start(rx.defer(lambda _: playback.state(timeline, self._epoch.elapsed())))

    def events(self, timeline: Events[T] | None) -> Observable[T]:
        """Return single events; a restarted process does not repeat them."""
        if timeline is None:
            return rx.never()
        resume = self._epoch.is_past
        return self._epoch.start(
            rx.defer(lambda _: playback.events(timeline, self._epoch.elapsed(), resume=resume))
        )
