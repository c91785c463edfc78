"""Reads scenarios: YAML files that state what the virtual sources do, and when (``deploy/scenarios/*.yaml``).

Times are seconds since the scenario's origin, values are SI units. No number is larger than 1e9, no period
shorter than 1 ms. Every key is optional; a source without a key follows its parameters. Before the origin,
the sources play nothing. ::

    l1: 2.0                                 # a constant
    l2:                                     # values, each from its time on
      - {at: 1.5, value: 3.0}
      - {at: 4.0, value: 2.5}
    theta1: {center: 0.8, amplitude: 0.5, period: 12.0}
                                            # a sweep: center + amplitude · sin(2π · t/period)
    theta2: {center: 0.8, amplitude: 0.5, period: 12.0, rate: 25.0, phase: 1.57, rest: 3.5}
                                            # its samples per second, what it is ahead [rad], and how long it
                                            # stays at each end [s]; without them 25, 0 and 0
    operator:
      pressed:                              # when the switch is pressed; without `to`: forever
        - {from: 0.0, to: 40.0}
      heartbeats: [41.942, 42.991]          # single heartbeats, in addition
    engines:                                # the commands of the virtual operator
      - {at: 5.0, command: turn_on}
    drive: {rate: 25.0}                     # theta1 and theta2 move only while the engines are on: their time
                                            # is that of the service `drive`, published at this rate [Hz]
    repeat: 60.0                            # everything except the sweeps starts again every 60 s

Every sample of a moving joint gives a position (``combine_latest``). If both joints move, a position shows a
full step of one joint after a part of its time, so the speed is about twice the true one. In ``demo.yaml``,
the joints take turns (``phase``, ``rest``). Any speed is also wrong by as much as `kinematics` is late. The
topic ``effector/twist`` has neither error: a speed guard should listen to that.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from interfaces import topics
from interfaces.limits import LARGEST
from interfaces.seam import replaceable
from interfaces.service import yaml_file
from interfaces.service.errors import UserError
from interfaces.sources.timeline import Events, Sweep

T = TypeVar("T")

SHORTEST = 0.001  # s, of a period
DRIVE_RATE = 25.0  # Hz, by default


@dataclass(frozen=True)
class Scenario:
    """The timelines of the virtual sources; a source without a timeline follows its parameters."""

    configuration: Mapping[str, Events[float] | Sweep] = field(default_factory=dict)
    """By the names in :data:`interfaces.topics.CONFIGURATION`."""
    pressed: Events[bool] | None = None
    heartbeats: Events[bool] | None = None
    commands: Events[str] | None = None
    drive: float | None = None
    """The rate [Hz] at which the drive moves the joints; without it, they move by themselves."""


@replaceable
def load(path: str | Path) -> Scenario:
    """Read a scenario from a file.

    :raises UserError: a line for each key of the scenario that is wrong, with file, key and reason.
    """
    document = yaml_file.load(path)
    try:
        return _scenario({} if document is None else document, path)
    except UserError as error:
        found = {str(error): None}
        for key, value in document.items() if isinstance(document, dict) else ():
            try:
                _scenario({key: value}, path)
            except UserError as another:
                found[str(another)] = None
        raise UserError("\n".join(found)) from None


def _scenario(document: Any, path: str | Path) -> Scenario:
    root = _Item(document, str(path), "")
    root.require(optional={*topics.CONFIGURATION, "operator", "engines", "drive", "repeat"})
    repeat = root["repeat"].number(SHORTEST) if "repeat" in root else None
    configuration = {
        name: _values(root[name], topic, repeat)
        for name, topic in topics.CONFIGURATION.items()
        if name in root
    }
    operator = root["operator"] if "operator" in root else _Item({}, root.path, "operator")
    operator.require(optional={"pressed", "heartbeats"})
    return Scenario(
        configuration,
        pressed=_pressed(operator["pressed"], repeat) if "pressed" in operator else None,
        heartbeats=operator["heartbeats"].events(_heartbeat, repeat) if "heartbeats" in operator else None,
        commands=root["engines"].events(_command, repeat) if "engines" in root else None,
        drive=_drive(root["drive"]) if "drive" in root else None,
    )


@dataclass(frozen=True)
class _Item:
    value: Any
    path: str
    key: str

    def error(self, reason: str) -> UserError:
        return UserError(f"{self.path}: {self.key or 'scenario'}: {reason}")

    def __contains__(self, key: str) -> bool:
        return key in self.value

    def __getitem__(self, key: str) -> _Item:
        return _Item(self.value[key], self.path, f"{self.key}.{key}" if self.key else key)

    def require(self, required: Set[str] = frozenset(), optional: Set[str] = frozenset()) -> None:
        keys = ", ".join(sorted(required | optional))
        if not isinstance(self.value, dict):
            raise self.error(f"must be a mapping with {keys}, not {reprlib.repr(self.value)}")
        for key in self.value:
            if key not in required | optional:
                raise self.error(f"unknown key {reprlib.repr(key)}, must be one of {keys}")
        for key in sorted(required - self.value.keys()):
            raise self.error(f"missing key {key!r}")

    def number(self, least: float = -math.inf, *, above: float = -math.inf, most: float = math.inf) -> float:
        if isinstance(self.value, bool) or not isinstance(self.value, int | float):
            raise self.error(f"must be a number, not {reprlib.repr(self.value)}")
        if not -LARGEST <= self.value <= LARGEST:  # this refuses NaN
            raise self.error(f"must be from {-LARGEST:g} to {LARGEST:g}")
        if self.value < least:
            raise self.error(f"must be at least {least:g}, not {self.value:g}")
        if self.value <= above:
            raise self.error(f"must be more than {above:g}, not {self.value:g}")
        if self.value > most:
            raise self.error(f"must be at most {most:g}, not {self.value:g}")
        return float(self.value)

    def items(self) -> list[_Item]:
        if not isinstance(self.value, list):
            raise self.error(f"must be a list, not {reprlib.repr(self.value)}")
        return [_Item(value, self.path, f"{self.key}[{index}]") for index, value in enumerate(self.value)]

    def events(self, parse: Callable[[_Item], tuple[float, T]], repeat: float | None) -> Events[T]:
        events: list[tuple[float, T]] = []
        for item in self.items():
            event = parse(item)
            if events and event[0] < events[-1][0]:
                raise item.error(f"is at {event[0]:g} s, before the previous entry")
            events.append(event)
        if not events:
            raise self.error("is empty")
        return self.repeated(events, repeat)

    def repeated(self, events: list[tuple[float, T]], repeat: float | None) -> Events[T]:
        if repeat is not None and events[-1][0] >= repeat:
            raise self.error(f"ends at {events[-1][0]:g} s, but everything starts again after {repeat:g} s")
        return Events(tuple(events), repeat)


def _values(item: _Item, topic: topics.Topic, repeat: float | None) -> Events[float] | Sweep:
    """Parse the timeline of a configuration topic; the contract must allow its values."""

    def value(given: _Item) -> float:
        number = given.number()
        if problem := topic.problem(number):
            raise given.error(problem)
        return number

    def event(given: _Item) -> tuple[float, float]:
        given.require({"at", "value"})
        return given["at"].number(0.0), value(given["value"])

    if isinstance(item.value, list):
        return item.events(event, repeat)
    if not isinstance(item.value, dict):
        return Events(((0.0, value(item)),))
    sweep = _sweep(item)
    if problem := topic.problem(sweep.center - sweep.amplitude):
        raise item["amplitude"].error(f"at its lowest, {problem}")
    return sweep


def _sweep(item: _Item) -> Sweep:
    item.require({"center", "amplitude", "period"}, {"rate", "phase", "rest"})
    sweep = Sweep(
        item["center"].number(),
        item["amplitude"].number(0.0),
        item["period"].number(SHORTEST),
        rate=item["rate"].number(0.001, most=1000.0) if "rate" in item else Sweep.rate,
        phase=item["phase"].number() if "phase" in item else Sweep.phase,
        rest=item["rest"].number(0.0) if "rest" in item else Sweep.rest,
    )
    if sweep.rest >= sweep.period / 2:
        raise item["rest"].error(f"must be less than half the period, {sweep.period / 2:g} s")
    return sweep


def _drive(item: _Item) -> float:
    item.require(optional={"rate"})
    return item["rate"].number(1.0, most=1000.0) if "rate" in item else DRIVE_RATE


def _pressed(item: _Item, repeat: float | None) -> Events[bool]:
    changes: list[tuple[float, bool]] = []
    for entry in item.items():
        entry.require({"from"}, {"to"})
        if changes and changes[-1][1]:
            raise entry.error("comes after an entry without `to`")
        begin = entry["from"].number(changes[-1][0] if changes else 0.0)
        changes.append((begin, True))
        if "to" in entry:
            changes.append((entry["to"].number(above=begin), False))
    return item.repeated(changes or [(0.0, False)], repeat)


def _heartbeat(item: _Item) -> tuple[float, bool]:
    return item.number(0.0), True


def _command(item: _Item) -> tuple[float, str]:
    item.require({"at", "command"})
    command = item["command"]
    if command.value not in (topics.TURN_ON, topics.TURN_OFF):
        raise command.error(
            f"must be {topics.TURN_ON} or {topics.TURN_OFF}, not {reprlib.repr(command.value)}"
        )
    return item["at"].number(0.0), command.value
