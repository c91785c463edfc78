"""Histories made by hand: a good one, and functions that plant violations in it."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from interfaces import topics
from interfaces.robot_model import forward_kinematics
from tests.promises.history import Condition, History, InjectedFault, Life, Sample, programs_of_manifest

END = 60.0
RATES: dict[str, float] = {
    "l1": 10.0,
    "l2": 10.0,
    "theta1": 25.0,
    "theta2": 25.0,
    "driven_time": 25.0,
    "operator_heartbeat": 20.0,
    "operator_presence": 2.0,
    "engines/state": 10.0,
}


SHORT_NAMES = {
    "heartbeats": "operator_heartbeat",
    "presences": "operator_presence",
    "commands": "engines",
    "conclusions": "operator_activity",
    "states": "engines/state",
    "positions": "effector/position",
    "speeds": "effector/speed",
    "health": "/diagnostics",
}


def samples(messages: Iterable[tuple[float, Any]], delay: float = 0.0) -> list[Sample]:
    """Return messages in the order of sending, each received ``delay`` [s] after it was sent."""
    return sorted((Sample(at, at + delay, value) for at, value in messages), key=lambda each: each.sent)


def history(
    *,
    end: float = 40.0,
    lives: Sequence[Life] = (),
    faults: Iterable[InjectedFault | Condition] = (),
    delay: float = 0.0,
    **messages: Iterable[tuple[float, Any]],
) -> History:
    """Return a history with these messages, by the names of their topics or by short names."""
    streams = {SHORT_NAMES.get(name, name): samples(items, delay) for name, items in messages.items()}
    return faulty(History(end, streams, [*lives]), *faults)


def _times(rate: float) -> list[float]:
    return [step / rate for step in range(1, int(END * rate))]


def value_at(topic: str, time: float) -> float:
    return 2.0 + math.sin(time * (1 + len(topic)) / 7)


@cache
def good() -> History:
    """Return a minute in which the operator turns the engines on at 5 s and nothing dies."""
    streams: dict[str, list[Sample]] = {topic.name: [] for topic in topics.CONTRACT}
    for name, rate in RATES.items():
        streams[name] = [Sample(t, t + 0.001, _value(name, t)) for t in _times(rate)]
    for t in _times(50.0):
        values = [_latest(streams[name], t) for name in topics.CONFIGURATION]
        if None not in values:
            streams["effector/position"].append(Sample(t, t + 0.001, forward_kinematics(*values)))
            streams["effector/speed"].append(Sample(t, t + 0.001, 0.5))
    streams["joint_states"] = [Sample(t, t + 0.001, None) for t in _times(25.0)]
    streams["engines"] = [Sample(4.95, 4.951, topics.TURN_ON)]
    pids = {name: 100 + index for index, name in enumerate(programs_of_manifest())}
    streams["/diagnostics"] = sorted(Sample(t, t + 0.001, each) for t in _times(1.0) for each in pids.items())
    lives = [Life(name, pid, 0.0, None) for name, pid in pids.items()]
    return History(END, streams, [Life("", 99, 0.0, None), *lives], [])


def _value(name: str, time: float) -> Any:
    if name == "operator_heartbeat":
        return True
    if name == "engines/state":
        return topics.ON if time >= 5.0 else topics.OFF
    if name == "driven_time":
        return max(0.0, time - 5.5), "host"
    return time if name == "operator_presence" else value_at(name, time)


def _latest(samples: list[Sample], time: float) -> Any:
    index = bisect_right(samples, time, key=lambda s: s.sent)
    return samples[index - 1].value if index else None


def change(history: History, topic: str, how: Callable[[Sample], Sample | None]) -> History:
    samples = sorted(new for s in history.streams[topic] if (new := how(s)) is not None)
    return replace(history, streams=history.streams | {topic: samples})


def silent(history: History, topic: str, begin: float, end: float) -> History:
    return change(history, topic, lambda s: None if begin < s.sent < end else s)


def with_value(history: History, topic: str, value: Any, begin: float, end: float = END) -> History:
    return change(history, topic, lambda s: s._replace(value=value) if begin < s.sent < end else s)


def added(history: History, topic: str, *samples: tuple[float, Any]) -> History:
    new = [Sample(t, t + 0.001, value) for t, value in samples]
    return replace(history, streams=history.streams | {topic: sorted([*history.streams[topic], *new])})


def faulty(history: History, *events: InjectedFault | Condition) -> History:
    faults = [*history.faults, *(each for each in events if isinstance(each, InjectedFault))]
    conditions = [each for each in events if isinstance(each, Condition)]
    return replace(
        history,
        faults=sorted(faults, key=lambda f: f.begin),
        conditions=[*history.conditions, *conditions],
    )


def killed(history: History, program: str, at: float, back: float) -> History:
    """Return the history with a program killed, and its output back after ``back`` [s]."""
    old = next(life for life in history.lives if life.program == program)
    new = Life(program, old.pid + 1000, at + 0.05, None)
    lives = [life._replace(ended=at) if life is old else life for life in history.lives]
    history = faulty(replace(history, lives=[*lives, new]), InjectedFault("kill", program, at, at, old.pid))
    streams = [topic.name for topic in topics.CONTRACT if topic.publishers == (program,)]
    for topic in streams:
        history = silent(history, topic, at, at + back)
    return change(
        history,
        "/diagnostics",
        lambda s: s if s.value[0] != program or s.sent <= at else _successor(s, new.pid, at + back),
    )


def succeeded(history: History, program: str, at: float) -> History:
    """Return the history in which the process of a program ends, and a successor starts."""
    old = next(life for life in history.lives if life.program == program)
    lives = [life._replace(ended=at) if life is old else life for life in history.lives]
    return replace(history, lives=[*lives, Life(program, old.pid + 1000, at, None)])


def _successor(sample: Sample, pid: int, since: float) -> Sample | None:
    return sample._replace(value=(sample.value[0], pid)) if sample.sent >= since else None
