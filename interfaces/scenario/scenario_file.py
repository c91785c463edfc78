"""Scenarios: what the virtual sources do, and when (``deploy/scenarios/*.yaml``).

Times are seconds since the scenario's origin, which all sources share; values are SI units. Every key may be
left out; a source that no scenario drives follows its parameters. ::

    l1: 2.0                                 # a value, from the origin on
    l2: 3.0
    theta1: {center: 0.8, amplitude: 0.5, period: 12.0, rate: 25.0, phase: 0.0, delay: 0.0}
                                            # center + amplitude · sin(2π · t/period + phase), `rate` times a
                                            # second: at `delay` + n / `rate`, before the origin, too
    theta2:                                 # values, each from its time on
      - {at: 1.5, value: 0.8}
      - {at: 4.0, value: 1.8}
    operator:
      pressed:                              # the switch is held: from, and until; without `to` for ever
        - {from: 0.0, to: 40.0}
      let_go: {every: 20.0, for: 1.0}       # the last second of every 20 s the switch is not held after all
      heartbeats: [1.942, 1.991]            # single signals of the switch, beside those while it is held
    engines:                                # what the virtual operator wants of the engines
      - {at: 5.0, command: turn_on}
    repeat: 60.0                            # all but the sweeps and `let_go` starts again every 60 s

``rate`` (25 Hz), ``phase`` (0 rad) and ``delay`` (0 s) have these defaults.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from interfaces import topics
from interfaces.scenario import yaml_file
from interfaces.scenario.timeline import Events, Sweep, Timeline
from interfaces.service.errors import UserError

T = TypeVar("T")


@dataclass(frozen=True)
class Scenario:
    """What the virtual sources do; ``None`` where the scenario leaves it to their parameters."""

    configuration: Mapping[str, Timeline[float]] = field(default_factory=dict)
    """Of the sources named in :data:`interfaces.topics.CONFIGURATION`, those that the scenario drives."""
    pressed: Timeline[bool] | None = None
    heartbeats: Timeline[bool] | None = None
    commands: Timeline[str] | None = None


def load(path: str | Path) -> Scenario:
    """Read a scenario from a file. Raises UserError: one line with file, key and reason."""
    document = yaml_file.load(path)
    return _scenario(_Item({} if document is None else document, str(path), ""))


def _scenario(root: _Item) -> Scenario:
    root.allow({*topics.CONFIGURATION, "operator", "engines", "repeat"})
    repeat = root["repeat"].number(above=0.0) if "repeat" in root else None
    configuration = {
        name: _values(root[name], topic, repeat)
        for name, topic in topics.CONFIGURATION.items()
        if name in root
    }
    operator = root["operator"] if "operator" in root else _Item({}, root.path, "operator")
    operator.allow({"pressed", "let_go", "heartbeats"})
    heartbeats = (
        operator["heartbeats"].events(lambda item: (item.number(0.0), True), repeat)
        if ("heartbeats" in operator)
        else None
    )
    commands = root["engines"].events(_command, repeat) if "engines" in root else None
    return Scenario(configuration, _presses(operator, repeat), heartbeats, commands)


def _values(item: _Item, topic: topics.Topic, repeat: float | None) -> Timeline[float]:
    """Understand the timeline of a manipulator parameter, whose values the contract must allow."""

    def value(given: _Item) -> float:
        number = given.number()
        if problem := topic.problem(topic.type(data=number)):
            raise given.error(problem)
        return number

    def event(given: _Item) -> tuple[float, float]:
        given.require({"at", "value"})
        return given["at"].number(0.0), value(given["value"])

    if isinstance(item.value, list):
        return item.events(event, repeat)
    if not isinstance(item.value, dict):
        return Events(((0.0, value(item)),))
    item.require({"center", "amplitude", "period"}, {"rate", "phase", "delay"})
    sweep = Sweep(
        item["center"].number(),
        item["amplitude"].number(0.0),
        item["period"].number(above=0.0),
        item["rate"].number(above=0.0, most=1000.0) if "rate" in item else Sweep.rate,
        item["phase"].number() if "phase" in item else Sweep.phase,
        item["delay"].number(0.0) if "delay" in item else Sweep.delay,
    )
    if problem := topic.problem(topic.type(data=sweep.center - sweep.amplitude)):
        raise item["amplitude"].error(f"at its lowest, {problem}")
    return sweep


def _command(item: _Item) -> tuple[float, str]:
    item.require({"at", "command"})
    command = item["command"]
    if command.value not in (topics.TURN_ON, topics.TURN_OFF):
        raise command.error(f"must be {topics.TURN_ON} or {topics.TURN_OFF}, not {command.value!r}")
    return item["at"].number(0.0), command.value


def _presses(operator: _Item, repeat: float | None) -> Timeline[bool] | None:
    if "pressed" not in operator:
        if "let_go" in operator:
            raise operator["let_go"].error("needs `pressed`: there is nothing to let go of")
        return None
    changes: list[tuple[float, bool]] = []
    for item in operator["pressed"].items():
        item.require({"from"}, {"to"})
        begin = item["from"].number(changes[-1][0] if changes else 0.0)
        if changes and changes[-1][1]:
            raise item.error("comes after one that lasts for ever")
        changes.append((begin, True))
        if "to" in item:
            changes.append((item["to"].number(above=begin), False))
    operator["pressed"].within(repeat, changes)
    held = Events(tuple(changes) or ((0.0, False),), repeat)
    if "let_go" not in operator:
        return held
    let_go = operator["let_go"]
    let_go.require({"every", "for"})
    every = let_go["every"].number(above=0.0)
    pause = let_go["for"].number(above=0.0)
    if pause >= every:
        raise let_go["for"].error(f"must be less than `every`, {every:g} s")
    return _LetGo(held, Events(((0.0, True), (every - pause, False)), every))


@dataclass(frozen=True)
class _LetGo:
    """Pressed while both hold: the operator means to press, and does not let go just now."""

    held: Timeline[bool]
    grip: Timeline[bool]
    catches_up = True

    def at(self, time: float) -> bool:
        return bool(self.held.at(time)) and bool(self.grip.at(time))

    def after(self, time: float) -> Iterator[tuple[float, bool]]:
        now = {"held": bool(self.held.at(time)), "grip": bool(self.grip.at(time))}
        held = ((at, "held", value) for at, value in self.held.after(time))
        grip = ((at, "grip", value) for at, value in self.grip.after(time))
        for at, changes in itertools.groupby(heapq.merge(held, grip), key=lambda change: change[0]):
            now.update((which, value) for _, which, value in changes)
            yield at, all(now.values())


@dataclass(frozen=True)
class _Item:
    """A value in the file, which knows where it stands."""

    value: Any
    path: str
    key: str

    def error(self, reason: str) -> UserError:
        return UserError(f"{self.path}: {self.key or 'scenario'}: {reason}")

    def __contains__(self, key: str) -> bool:
        return key in self.value

    def __getitem__(self, key: str) -> _Item:
        return _Item(self.value[key], self.path, f"{self.key}.{key}" if self.key else key)

    def allow(self, keys: set[str]) -> None:
        if not isinstance(self.value, dict):
            raise self.error(f"must be a mapping with {_listed(keys)}, not {self.value!r}")
        for key in self.value:
            if key not in keys:
                raise self.error(f"unknown key {key!r}, must be one of {_listed(keys)}")

    def require(self, keys: set[str], optional: set[str] = frozenset()) -> None:  # type: ignore[assignment]
        self.allow(keys | optional)
        for key in sorted(keys - self.value.keys()):
            raise self.error(f"lacks {key!r}")

    def number(self, least: float = -math.inf, *, above: float = -math.inf, most: float = math.inf) -> float:
        if isinstance(self.value, bool) or not isinstance(self.value, int | float):
            raise self.error(f"must be a number, not {self.value!r}")
        if not math.isfinite(self.value):
            raise self.error(f"must be finite, not {self.value}")
        if self.value < least:
            raise self.error(f"must be at least {least:g}, not {self.value:g}")
        if self.value <= above:
            raise self.error(f"must be more than {above:g}, not {self.value:g}")
        if self.value > most:
            raise self.error(f"must be at most {most:g}, not {self.value:g}")
        return float(self.value)

    def items(self) -> list[_Item]:
        if not isinstance(self.value, list):
            raise self.error(f"must be a list, not {self.value!r}")
        return [_Item(value, self.path, f"{self.key}[{index}]") for index, value in enumerate(self.value)]

    def events(self, understand: Callable[[_Item], tuple[float, T]], repeat: float | None) -> Events[T]:
        items: list[tuple[float, T]] = []
        for item in self.items():
            event = understand(item)
            if items and event[0] < items[-1][0]:
                raise item.error(f"comes at {event[0]:g} s, before the one in front of it")
            items.append(event)
        if not items:
            raise self.error("is empty")
        self.within(repeat, items)
        return Events(tuple(items), repeat)

    def within(self, repeat: float | None, items: list[tuple[float, Any]]) -> None:
        if repeat is not None and items and items[-1][0] >= repeat:
            raise self.error(f"lasts until {items[-1][0]:g} s, but all starts again after {repeat:g} s")


def _listed(keys: set[str]) -> str:
    return ", ".join(sorted(keys))
