"""How soon the engines stop: what follows from the parameters of the arm (deploy/SAFETY.md derives it)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, NamedTuple

from interfaces.service import UserError
from interfaces.topics import CLOCK_TOLERANCE, DRIVE_TIMEOUT
from services import dead_mans_switch, engine_controller, operator_watchdog

DELAY = 0.05  # s of scheduling and transport on the way to the drive
BEAT = 0.05  # s between two heartbeats of a switch; the virtual one may be slower
RESTART = 1.2  # s from the death of the operator watchdog to its next presence, on two busy cores


class Reaction(NamedTuple):
    """The parameters that decide how soon the engines stop, and the bounds that follow [s]."""

    watchdog: operator_watchdog.Parameters
    controller: engine_controller.Parameters
    switch: dead_mans_switch.Parameters

    @property
    def off_within(self) -> float:
        """From the last sign of life until the engines are off, whatever dies: F3 acts after F2."""
        return round(self._by_timeout + DRIVE_TIMEOUT + DELAY, 3)

    @property
    def off_after_one_death(self) -> float:
        """The same if the watchdog or the controller dies: F2 acts, or F3 after F1."""
        by_drive = min(self._by_strikes, self._by_timeout) + DRIVE_TIMEOUT
        return round(max(self._by_timeout + self.controller.repeat, by_drive) + DELAY, 3)

    @property
    def off_undisturbed(self) -> float:
        """The same if nothing dies: F1 acts, or F2 if its time is shorter."""
        return round(min(self._by_strikes, self._by_timeout + self.controller.repeat) + DELAY, 3)

    @property
    def by_strikes_in_time(self) -> bool:
        """Whether the watchdog alone (F1) acts within the bound of S1; else F2 acts before it."""
        return self._by_strikes + DELAY <= self.off_within

    @property
    def longest_restart(self) -> float:
        """How long the watchdog may be away while the engines stay on."""
        return round(self.controller.presence_timeout - self.watchdog.lifespan - self.watchdog.sampling, 3)

    def longest_unseen(self, beat: float) -> float:
        """How old the last report of a present operator may become, by the period of the switch [s]."""
        return round(self.watchdog.sampling + self.watchdog.reading + beat + DELAY, 3)

    @property
    def words(self) -> str:
        """What happens without a hand, in one sentence without a full stop: the words of the page."""
        return (
            f"Let go: engines off within {self.off_undisturbed:g} s,"
            f" or {self.off_within:g} s if programs crash"
        )

    def check(self) -> None:
        """Raise UserError if no arm can work with these parameters."""
        watchdog, controller = self.watchdog, self.controller
        least = 2 * CLOCK_TOLERANCE
        if watchdog.lifespan < least:
            raise UserError(
                f"lifespan must be at least {least:g} s, not {watchdog.lifespan:g}: "
                f"a heartbeat waits for up to half of it, and clocks differ by up to {CLOCK_TOLERANCE:g} s"
            )
        beat = max(BEAT, 1.0 / self.switch.rate)
        least = round(watchdog.sampling + 2 * beat, 3)
        if watchdog.silence < least:
            raise UserError(
                f"silence must be at least {least:g} s, not {watchdog.silence:g}: sampling and two periods of"
                f" the switch (dead_mans_switch.rate), {beat:g} s each: one lost heartbeat is no strike"
            )
        # An operator who returned between the strikes was seen until one silence before the last of them.
        most = round(min(watchdog.silence, watchdog.strikes * watchdog.silence - watchdog.sampling - BEAT), 3)
        if controller.max_presence_age > most:
            raise UserError(
                f"max_presence_age must be at most {most:g} s, not {controller.max_presence_age:g}: "
                "a turn_on after the last strike would turn the engines on without an operator"
            )
        if controller.max_presence_age < (least := self.longest_unseen(beat)):
            raise UserError(
                f"max_presence_age must be at least {least:g} s, not {controller.max_presence_age:g}: "
                "an operator who is present is reported only so often (sampling, dead_mans_switch.rate)"
            )
        if self.longest_restart < RESTART:
            least = watchdog.lifespan + watchdog.sampling + RESTART
            raise UserError(
                f"presence_timeout must be at least {least:g} s, not {controller.presence_timeout:g}: "
                f"lifespan, sampling and a restart of the operator watchdog, {RESTART:g} s"
            )

    @property
    def _by_strikes(self) -> float:
        """From the last sign of life until the watchdog sends `turn_off` (F1)."""
        watchdog = self.watchdog
        return watchdog.lifespan + watchdog.sampling + watchdog.strikes * watchdog.silence

    @property
    def _by_timeout(self) -> float:
        """From the last sign of life until the controller sends no further `on` (F2)."""
        return self.controller.presence_timeout + CLOCK_TOLERANCE


def reaction(given: Mapping[str, Mapping[str, Any]]) -> Reaction:
    """Return the reaction of an arm.

    :param given: parameters by program; those that are not given have their defaults.
    :raises UserError: if the values of one program contradict each other.
    """

    def of(program: str, defaults: Any) -> Any:
        known = {field.name for field in fields(defaults)}
        values = {name: value for name, value in given.get(program, {}).items() if name in known}
        return replace(defaults, **values)

    return Reaction(
        of("operator_watchdog", operator_watchdog.DEFAULTS),
        of("engine_controller", engine_controller.DEFAULTS),
        of("dead_mans_switch", dead_mans_switch.Parameters()),
    )
