"""Settings: parameters that a user sets by hand, and that survive a restart of the process."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import reactivex as rx
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter
from reactivex import Observable
from reactivex.subject import Subject

from interfaces.service import ServiceNode, UserError, parameter
from interfaces.service.health import BY_HAND
from interfaces.sources import playback
from interfaces.sources.settings_file import SettingsFile


@dataclass(frozen=True)
class _Parameters:
    settings: str = parameter("", None, "", "folder of the parameters that were set by hand, or empty")


class Settings:
    """The parameters of a node that survive a restart."""

    def __init__(self, node: ServiceNode, *, is_restart: bool) -> None:
        """Declare the parameter that names the folder, and read what the last process kept.

        :param is_restart: whether this process replaces one that died.
        :raises UserError: if the file of the settings has an error.
        """
        self._node = node
        self._file = SettingsFile(node.declare(_Parameters).settings, node.get_name())
        self._are_lost = is_restart and not self._file.exists
        if self._are_lost:
            node.remark("settings", "they are lost, with what was set by hand")
        elif not self._file.exists:
            self._save("settings")
        self._settings: list[Setting] = []
        node.add_post_set_parameters_callback(self._parameters_were_set)

    def keep(self, name: str, *, given_back: str = "", if_lost: Any = None) -> Setting:
        """Keep a parameter of the node.

        :param given_back: a boolean parameter: whether the setting is given back to what it replaces. Setting
            the parameter by hand makes it false.
        :param if_lost: the value of a restarted process that does not know any more what was set by hand, as
            if it was set; by default, nothing is set then.
        :raises UserError: if the setting of the last process is bad.
        """
        first = self._node.get_parameter(name).value
        if self._are_lost and if_lost is not None:
            self._file.values[name] = if_lost
            self._save(name)
        is_set = name in self._file.values
        if is_set:
            self._declare_again(name, self._file.values[name])
            if given_back:
                self._declare_again(given_back, False)
        setting = Setting(self._node, name, given_back, first, is_set)
        self._settings.append(setting)
        return setting

    def recall(self, name: str, default: float) -> float:
        """Return the number that the last process remembered. Raises UserError if it is no number."""
        value = self._file.values.get(name, default)
        if not isinstance(value, float):
            raise UserError(f"{name} was {value!r}: not a float")
        return value

    def remember(self, name: str, value: float) -> bool:
        """Keep a number for the next process. If that fails, report it, and keep the last one.

        :returns: whether it is kept.
        """
        values = self._file.values
        if values.get(name) == value and self._file.exists:
            return True
        self._file.values = {**values, name: value}
        try:
            self._file.save()
        except UserError as error:
            self._file.values = values
            self._node.remark(name, f"it stands still, because it cannot be kept: {error}")
            return False
        return True

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

    def _parameters_were_set(self, parameters: list[Parameter]) -> None:
        values = {each.name: each.value for each in parameters}
        for setting in self._settings:
            if values.get(setting.given_back):
                self._file.values.pop(setting.name, None)
                self._save(setting.name)
            elif setting.name in values or setting.given_back in values:
                self._file.values[setting.name] = self._node.get_parameter(setting.name).value
                self._save(setting.name)
            if setting.name in values:
                if setting.given_back:
                    self._node.set_parameters([Parameter(setting.given_back, value=False)])
                setting.set_by_hand.on_next(None)

    def _save(self, name: str) -> None:
        try:
            self._file.save()
        except UserError as error:
            self._file.remove()
            self._node.remark(name, f"a restart would forget the setting: {error}")


class Setting:
    """A parameter that is kept. A user sets it by hand in place of something that is played."""

    def __init__(self, node: ServiceNode, name: str, given_back: str, first: Any, is_set: bool) -> None:
        """:param is_set: whether a process before this one kept it."""
        self.name, self.given_back = name, given_back
        self._node = node
        self._first = first
        self._is_set = is_set
        self.set_by_hand: Subject[None] = Subject()
        self.values: Observable[Any] = node.create_parameter_observable(name)
        """The present value, and each value that is set."""

    def instead_of(self, played: Observable[Any] | None) -> Observable[Any]:
        """Emit what is played until the parameter is set by hand, then the values of the parameter.

        A parameter that is given back is followed by what is played again. If nothing is played, its first
        value takes that place.
        """
        if self.given_back:
            follows = self._node.create_parameter_observable(self.given_back).distinct_until_changed()
            by_hand = self._node.stating({BY_HAND: self.name}, self.values)
            return follows.switch_map(
                lambda follows: (played or rx.just(self._first)) if follows else by_hand
            )
        return self.values if self._is_set else playback.follow(self.values, played)

    def until_set(self, played: Observable[Any]) -> Observable[Any]:
        """Emit what is played until the parameter is set by hand; nothing if it was set before a restart."""
        return rx.never() if self._is_set else played.take_until(self.set_by_hand)
