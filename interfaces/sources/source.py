"""A virtual source: follows its scenario until its parameter is set by hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import reactivex as rx
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter
from reactivex import Observable
from reactivex.subject import Subject

from interfaces.service import ServiceNode, UserError, parameter
from interfaces.service.epoch import Epoch
from interfaces.sources import playback
from interfaces.sources.scenario_file import Scenario, load
from interfaces.sources.settings_file import Settings
from interfaces.sources.timeline import Events, Sweep

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

        :raises UserError: if the scenario or the settings have an error.
        """
        parameters = node.declare(_Parameters)
        self._node = node
        self._epoch = Epoch(node)
        self._settings = Settings(parameters.settings, node.get_name())
        self._are_lost = self._epoch.is_past and not self._settings.exist
        if self._are_lost:
            node.remark("settings", "they are lost, with what was set by hand")
        elif not self._settings.exist:
            self._save("settings")
        self._followed: dict[str, str] = {}  # with the parameter that gives it back, if it has one
        self._set_by_hand: Subject[str] = Subject()
        node.add_post_set_parameters_callback(self._keep)
        self.scenario = load(parameters.scenario) if parameters.scenario else Scenario()

    def follow(
        self,
        name: str,
        timeline: Events[T] | Sweep | None = None,
        *,
        given_back: str = "",
        if_lost: T | None = None,
    ) -> Observable[T]:
        """
        Return the values of a parameter, or those of a timeline until the parameter is set by hand.

        A restarted process keeps the parameter that was set. See :func:`playback.follow`.

        :param given_back: a boolean parameter: whether the timeline is followed, or the first value of the
            parameter without a timeline. Setting the parameter by hand makes it false; setting it to true
            gives the source back.
        :param if_lost: the value of a restarted process that does not know any more what was set by hand, as
            if it was set; by default, such a process follows the timeline.
        :raises UserError: if the setting of the last process is bad.
        """
        first = self._node.get_parameter(name).value
        if self._are_lost and if_lost is not None:
            self._settings.values[name] = if_lost
            self._save(name)
        is_set = name in self._settings.values
        if is_set:
            self._declare_again(name, self._settings.values[name])
            if given_back:
                self._declare_again(given_back, False)
        self._followed[name] = given_back

        values: Observable[T] = self._node.create_parameter_observable(name)
        played: Observable[T] | None = None
        if timeline is not None:
            played = self._epoch.start(rx.defer(lambda _: playback.state(timeline, self._epoch.elapsed())))
        if not given_back:
            return values if is_set else playback.follow(values, played)
        follows = self._node.create_parameter_observable(given_back).distinct_until_changed()
        return follows.switch_map(lambda follows: (played or rx.just(first)) if follows else values)

    def play(self, timeline: Events[T] | None) -> Observable[T]:
        """Return the single events of a timeline; a restarted process does not repeat them."""
        if timeline is None:
            return rx.never()
        played = rx.defer(
            lambda _: playback.events(timeline, self._epoch.elapsed(), resume=self._epoch.is_past)
        )
        return self._epoch.start(played)

    def until_set(self, name: str, items: Observable[T]) -> Observable[T]:
        """Return items until a parameter is set by hand; none if a process before this one kept it."""
        if name in self._settings.values:
            return rx.never()
        return items.take_until(self._set_by_hand.filter(lambda it: it == name))

    def _declare_again(self, name: str, value: Any) -> None:
        """Replace the value of a parameter, without the event of a parameter that is set by hand."""
        descriptor, kind = self._node.describe_parameter(name), type(self._node.get_parameter(name).value)
        if type(value) is not kind:
            raise UserError(f"{name} was set to {value!r}: not a {kind.__name__}")
        self._node.undeclare_parameter(name)
        try:
            self._node.declare_parameter(name, value, descriptor, ignore_override=True)
        except ParameterException as error:
            raise UserError(f"{name} was set to {value!r}: {error}") from None

    def _keep(self, parameters: list[Parameter]) -> None:
        values = {each.name: each.value for each in parameters}
        for name, given_back in self._followed.items():
            if values.get(given_back):
                self._settings.values.pop(name, None)
                self._save(name)
            elif name in values or given_back in values:
                self._settings.values[name] = self._node.get_parameter(name).value
                self._save(name)
            if name in values:
                if given_back:
                    self._node.set_parameters([Parameter(given_back, value=False)])
                self._set_by_hand.on_next(name)

    def _save(self, name: str) -> None:
        try:
            self._settings.save()
        except UserError as error:
            self._node.remark(name, f"a restart would forget the setting: {error}")
