"""A virtual source: what a service needs that follows its parameters or a scenario."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import reactivex as rx
from rclpy.parameter import Parameter
from reactivex import Observable

from interfaces.scenario import playback
from interfaces.scenario.origin import Origin
from interfaces.scenario.scenario_file import Scenario, load
from interfaces.scenario.settings import Settings
from interfaces.scenario.timeline import Timeline
from interfaces.service import ServiceNode, UserError, parameter

T = TypeVar("T")


@dataclass(frozen=True)
class _Parameters:
    scenario: str = parameter("", None, "", "file of the scenario, or empty")
    settings: str = parameter("", None, "", "folder that keeps what was set by hand, or empty")


class VirtualSource:
    """The scenario and the parameters of a node that plays a part of it."""

    def __init__(self, node: ServiceNode) -> None:
        """
        Declare the parameters on a node and load the scenario that they name.

        :raises UserError: if the scenario has an error.
        """
        parameters = node.declare(_Parameters)
        self._node = node
        self._origin = Origin(node)
        self._settings = Settings(parameters.settings, node.get_name())
        self.scenario = load(parameters.scenario) if parameters.scenario else Scenario()

    def play(self, timeline: Timeline[T] | None, *, resume: bool = True) -> Observable[T] | None:
        """Return a timeline from where the scenario is now; see :func:`interfaces.scenario.playback.play`."""
        if timeline is None:
            return None
        return rx.defer(lambda _: playback.play(timeline, self._origin.elapsed(), resume=resume))

    def follow(self, name: str, timeline: Observable[T] | None = None) -> Observable[T]:
        """
        Return what a virtual source does: see :func:`interfaces.scenario.playback.follow`.

        What was set by hand holds beyond the end of this process.

        :raises UserError: if what was set can no longer be set, or read.
        """
        kept = self._settings.read()
        if name in kept:
            (result,) = self._node.set_parameters([Parameter(name, value=kept[name])])
            if not result.successful:
                raise UserError(f"{name} was set to {kept[name]!r}: {result.reason}")
            timeline = None

        def keep(parameters: list[Parameter]) -> None:
            if any(parameter.name == name for parameter in parameters):
                try:
                    self._settings.keep(name, self._node.get_parameter(name).value)
                except UserError as error:
                    self._node.remark(name, f"would be forgotten by a restart: {error}")

        self._node.add_post_set_parameters_callback(keep)
        return playback.follow(self._node.create_parameter_observable(name), timeline)

    def until_set(self, name: str, items: Observable[T]) -> Observable[T]:
        """Emit items until a parameter is set by hand; none if it was, before the end of the last process."""
        if name in self._settings.read():
            return rx.empty()
        return items.take_until(self._node.create_parameter_observable(name).skip(1))
