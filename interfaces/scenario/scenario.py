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
from datetime import timedelta
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

import reactivex as rx
import yaml
from reactivex import Observable, abc
from reactivex.disposable import MultipleAssignmentDisposable
from reactivex.scheduler import TimeoutScheduler

from interfaces import topics
from interfaces.scenario import unique_yaml

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)


class ScenarioError(ValueError):
    """A mistake in a scenario: one line that names the file, the key and the reason."""


class Timeline(Protocol[T_co]):
    """Values over time [s since the scenario's origin]."""

    catches_up: bool
    """Whether values whose time has passed unnoticed (a stopped process) are still worth something."""

    def at(self, time: float) -> T_co | None:
        """Return the value that holds at a time, ``None`` if there is none yet."""

    def after(self, time: float) -> Iterator[tuple[float, T_co]]:
        """Return the changes after a time, in order, each with its time."""


@dataclass(frozen=True)
class Events(Generic[T]):
    """Single values, each from its time on."""

    items: tuple[tuple[float, T], ...]
    repeat: float | None = None
    """All of them again and again, with this period [s]."""
    catches_up = True

    def at(self, time: float) -> T | None:
        """Return the last value up to a time."""
        value = None
        for _, item in itertools.takewhile(lambda item: item[0] <= time, self._around(time)):
            value = item
        return value

    def after(self, time: float) -> Iterator[tuple[float, T]]:
        """Return the values after a time."""
        return itertools.dropwhile(lambda item: item[0] <= time, self._around(time))

    def _around(self, time: float) -> Iterator[tuple[float, T]]:
        """Return the values since the beginning, or since a whole round before a time."""
        if self.repeat is None:
            return iter(self.items)
        rounds = itertools.count(max(0, math.floor(time / self.repeat) - 1))
        return ((at + round_ * self.repeat, item) for round_ in rounds for at, item in self.items)


@dataclass(frozen=True)
class Sweep:
    """center + amplitude · sin(2π · t/period + phase) at t = ``delay`` + n / ``rate``, n = …, -1, 0, 1, …"""

    center: float
    amplitude: float
    period: float
    rate: float = 25.0
    phase: float = 0.0
    delay: float = 0.0
    catches_up = False

    def at(self, time: float) -> float:
        """Return the value at a time."""
        return self.center + self.amplitude * math.sin(math.tau * time / self.period + self.phase)

    def after(self, time: float) -> Iterator[tuple[float, float]]:
        """Return the values after a time."""
        steps = itertools.count(math.floor((time - self.delay) * self.rate) + 1)
        times = (self.delay + step / self.rate for step in steps)
        return ((at, self.at(at)) for at in times)


@dataclass(frozen=True)
class Scenario:
    """What the virtual sources do; ``None`` where the scenario leaves it to their parameters."""

    configuration: Mapping[str, Timeline[float]] = field(default_factory=dict)
    """Of the sources named in :data:`interfaces.topics.CONFIGURATION`, those that the scenario drives."""
    pressed: Timeline[bool] | None = None
    heartbeats: Timeline[bool] | None = None
    commands: Timeline[str] | None = None


def play(timeline: Timeline[T], elapsed: float, *, resume: bool = True) -> Observable[T]:
    """
    Return a timeline as an observable that does not drift.

    :param elapsed: where in time it starts [s]; negative while the origin is still to come.
    :param resume: whether the value that holds already is emitted first, at once. Right for a state, wrong
    for
        events: what a restarted source has said before its death it does not say again.
    """

    def subscribe(
        observer: abc.ObserverBase[T], scheduler: abc.SchedulerBase | None = None
    ) -> abc.DisposableBase:
        clock = scheduler or TimeoutScheduler.singleton()
        origin = clock.now - timedelta(seconds=elapsed)
        upcoming = timeline.after(elapsed if resume else math.nextafter(elapsed, -math.inf))
        pending = MultipleAssignmentDisposable()

        def wait() -> None:
            for at, value in upcoming:
                due = origin + timedelta(seconds=at)
                if timeline.catches_up or due >= clock.now:
                    pending.disposable = clock.schedule_absolute(due, emit, value)
                    return
            observer.on_completed()

        def emit(_: abc.SchedulerBase, value: Any) -> None:
            observer.on_next(value)
            wait()

        present = timeline.at(elapsed) if resume else None
        if present is not None:
            observer.on_next(present)
        wait()
        return pending

    return Observable(subscribe)


def follow(parameter: Observable[T], timeline: Observable[T] | None) -> Observable[T]:
    """
    Return what a virtual source does that has a parameter and may have a timeline.

    Without a timeline that is the parameter's value at once, then what is set. With one, it is the timeline,
    and nothing before it begins; until somebody sets the parameter, who has taken over from then on.
    """
    if timeline is None:
        return parameter
    return parameter.skip(1).publish(lambda settings: rx.merge(timeline.take_until(settings), settings))


def load(path: str | Path) -> Scenario:
    """Read a scenario from a file. Raises ScenarioError for any mistake in it."""
    try:
        text = Path(path).read_text(encoding="utf-8")
        document = unique_yaml.load(text)
    except OSError as error:
        raise ScenarioError(f"{path}: {error.strerror}") from error
    except (yaml.YAMLError, ValueError) as error:
        raise ScenarioError(f"{path}: {' '.join(str(error).split())}") from error
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

    def error(self, reason: str) -> ScenarioError:
        return ScenarioError(f"{self.path}: {self.key or 'scenario'}: {reason}")

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
