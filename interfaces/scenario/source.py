"""A virtual source: follows its scenario until its parameter is set by hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import reactivex as rx
from rclpy.parameter import Parameter
from reactivex import Observable
from reactivex.subject import Subject

from interfaces.scenario import playback
from interfaces.scenario.origin import Origin
from interfaces.scenario.scenario_file import Scenario, load
from interfaces.scenario.settings import Settings
from interfaces.scenario.timeline import Events, Sweep
from interfaces.service import ServiceNode, UserError, parameter

T = TypeVar("T")


@dataclass(frozen=True)
class _Parameters:
    scenario: str = parameter("", None, "", "file of the scenario, or empty")
    settings: str = parameter("", None, "", "folder of the parameters that were set by hand, or empty")


class VirtualSource:
    """The part that a node plays in a scenario."""

    def __init__(self, node: ServiceNode) -> None:
        """
        Declare the parameters on a node and load the scenario that they name.

        :raises UserError: if the scenario has an error.
        """
        parameters = node.declare(_Parameters)
        self._node = node
        self._origin = Origin(node)
        self._settings = Settings(parameters.settings, node.get_name())
        self._followed: set[str] = set()
        self._set_by_hand: Subject[str] = Subject()
        node.add_post_set_parameters_callback(self._keep)
        self.scenario = load(parameters.scenario) if parameters.scenario else Scenario()

    def follow(self, name: str, timeline: Events[T] | Sweep | None = None) -> Observable[T]:
        """
        Return the values of a parameter, or those of a timeline until the parameter is set by hand.

        A restarted process goes on with the parameter that was set. See :func:`playback.follow`.

        :raises UserError: if the setting of the last process is bad.
        """
        settings = self._settings.read()
        if name in settings:
            (result,) = self._node.set_parameters([Parameter(name, value=settings[name])])
            if not result.successful:
                raise UserError(f"{name} was set to {settings[name]!r}: {result.reason}")

        self._followed.add(name)
        values: Observable[T] = self._node.create_parameter_observable(name)
        if timeline is None or name in settings:
            return values
        played = rx.defer(lambda _: playback.state(timeline, self._origin.elapsed()))
        return playback.follow(values, self._origin.delay_subscription(played))

    def play(self, timeline: Events[T] | None, *, until_set: str = "") -> Observable[T]:
        """
        Return the single events of a timeline; a restarted process does not repeat them.

        :param until_set: a parameter that ends the events when it is set by hand.
        """
        if timeline is None or until_set in self._settings.read():
            return rx.never()
        played = rx.defer(
            lambda _: playback.events(timeline, self._origin.elapsed(), resume=self._origin.is_past)
        )
        items = self._origin.delay_subscription(played)
        if not until_set:
            return items
        return items.take_until(self._set_by_hand.filter(lambda name: name == until_set))

    def _keep(self, parameters: list[Parameter]) -> None:
        for name in self._followed.intersection(each.name for each in parameters):
            try:
                self._settings.keep(name, self._node.get_parameter(name).value)
            except UserError as error:
                self._node.remark(name, f"a restart would forget the setting: {error}")
            self._set_by_hand.on_next(name)
