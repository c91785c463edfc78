"""The history of one arm: its messages, its processes and the injected faults.

Times are seconds since the record began, on the monotonic clock of the host.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from deploy.supervision import manifest
from deploy.supervision.reaction import Reaction, reaction
from interfaces import topics

SWITCH, WATCHDOG, CONTROLLER = "dead_mans_switch", "operator_watchdog", "engine_controller"
KINEMATICS, VELOCITY, ROBOT_STATE = "kinematics", "velocity", "robot_state"
DRIVE = "drive"
SENTINEL = manifest.SENTINEL
SOURCES = tuple(f"config_{name}" for name in topics.CONFIGURATION)
"""The publishers of the configuration, in its order."""

OPERATOR, ALL, NO_TARGET = "operator", "all", "nothing"
"""Targets of faults besides programs: the operator, the whole arm, and no part of the arm."""

OVERLOAD, LOSS, SILENCE = "overload", "loss", "silence"
CONDITIONS = (OVERLOAD, LOSS, SILENCE)
"""The kinds of conditions: the observer was not scheduled in time, messages to it were lost, the operator
released the switch."""

HOST = "host"
"""In the value of a health report, the name of the reporter's host."""
SAID = "said"
"""The message of a report of health that warns."""
PARTITION = "partition"
"""A fault of the network between the operator's host and the robot's."""
BAD_LINE = "bad_line"
"""A fault of the same network: it delays messages, and DDS has to send some of them again."""
FALSE_PRESENCE = "false_presence"
"""A stranger reports the operator's presence, so the engine controller does not turn off by itself (F2)."""
STUCK_DRIVE = "stuck_drive"
"""The drive keeps its last command, whether it is repeated or not (F3)."""
FUTURE_PRESENCE = "future_presence"
"""A stranger reports the operator's presence by a clock that is ahead by more than A3 allows."""
RIVAL = "rival"
"""A second controller, on another host, contradicts the first one."""
LOSE = "lose"
"""The messages that are sent on a topic in this time are lost; the topic is the target."""
HOLD = "hold"
"""The messages that are sent on a topic in this time arrive together at its end; the topic is the target."""

FLOODS = ("flood", "babble")
"""Faults in which a stranger sends many messages on a topic."""
SUSPENDING = ("stop", "pause", "hang", "hog", "slow")
"""Faults in which a process receives nothing until it continues or is replaced."""


def _outputs() -> dict[str, topics.Topic]:
    found: dict[str, topics.Topic] = {}
    for topic in topics.CONTRACT:
        if topic.longest_gap < math.inf and topic is not topics.DIAGNOSTICS:
            found.setdefault(topic.publishers[0], topic)
    return found


OUTPUTS = _outputs()
"""The topic that shows whether a program works: the first one that names it as its first publisher. The
health shows it for the other programs."""


def _dependents(program: str) -> tuple[str, ...]:
    direct = [name for name, topic in OUTPUTS.items() if topic.follows == OUTPUTS[program].name]
    return (*direct, *itertools.chain.from_iterable(map(_dependents, direct)))


DEPENDENTS = {
    **{program: _dependents(program) for program in OUTPUTS},
    OPERATOR: (SWITCH, *_dependents(SWITCH)),
}
"""The programs whose output stops when that of a program stops, or when the operator releases the switch."""


NEEDED_AT_START = dict.fromkeys((KINEMATICS, ROBOT_STATE), SOURCES)
"""The programs without which a program has no output after a restart: it needs a value from each of them."""


def programs_of_manifest() -> tuple[str, ...]:
    """Return the names of the programs of the manifest."""
    return tuple(program.name for program in manifest.programs())


class Sample(NamedTuple):
    sent: float
    """DDS source time."""
    received: float
    value: Any
    """The content: a float, a bool or a string; (x, y) of a position, (node, pid) of a health report, then
    (name, value) of each parameter that is not the default, what it reports of a movement, and its host."""


class Life(NamedTuple):
    """A process of the arm, from its start to its end."""

    program: str
    """The supervised program; empty for supervisord."""
    pid: int
    began: float
    ended: float | None
    """``None`` if the process was alive when the record ended."""
    words: str = ""
    """The last line that it wrote, if no signal ended it; empty if it is not known."""


class InjectedFault(NamedTuple):
    """A fault and its target."""

    kind: str
    target: str
    """A program, or one of :data:`OPERATOR`, :data:`ALL`, :data:`NO_TARGET`."""
    begin: float
    end: float
    """When the injection ended; equal to ``begin`` for a momentary fault."""
    pid: int = 0
    """The process that was hit; 0 if the target is not a program, or had no process."""
    ahead: float = 0.0
    """The lead of the arm's time of day over the machine's after the fault [s]."""


class Condition(NamedTuple):
    """What was the case for a while, without a fault: one of :data:`CONDITIONS`."""

    kind: str
    begin: float
    end: float


@dataclass(frozen=True)
class History:
    """The messages, processes, faults and conditions of one arm."""

    end: float
    streams: dict[str, list[Sample]] = field(default_factory=dict)
    """By topic name of the contract, in the order of sending."""
    lives: list[Life] = field(default_factory=list)
    faults: list[InjectedFault] = field(default_factory=list)
    conditions: list[Condition] = field(default_factory=list)
    programs: Sequence[str] = field(default_factory=programs_of_manifest)
    """Those that this arm has."""

    def lacks(self, program: str) -> bool:
        """Return whether the arm does not have a program. Without a drive, that program does nothing."""
        return program not in self.programs or (program == DRIVE and not self.stream(topics.DRIVEN_TIME))

    @cached_property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """What the services report, by program: each parameter with another value than its default."""
        given: dict[str, dict[str, Any]] = {}
        for sample in self.stream(topics.DIAGNOSTICS):
            node, _, *parameters = sample.value
            given.setdefault(node, {}).update(parameters)
        return given

    @cached_property
    def reaction(self) -> Reaction:
        """How soon the engines must stop, by the parameters that the services report."""
        return reaction(self.parameters)

    def stream(self, topic: topics.Topic) -> list[Sample]:
        return self.streams.get(topic.name, [])

    def output(self, program: str) -> list[Sample]:
        """Return the messages that show that a program works."""
        if topic := OUTPUTS.get(program):
            return self.stream(topic)
        return self.health(program)

    def health(self, program: str) -> list[Sample]:
        """Return the reports of health of a program."""
        return self._healths.get(program, [])

    @cached_property
    def _healths(self) -> dict[str, list[Sample]]:
        found: defaultdict[str, list[Sample]] = defaultdict(list)
        for sample in self.stream(topics.DIAGNOSTICS):
            found[sample.value[0]].append(sample)
        return found

    def signs_of_life(self) -> list[Sample]:
        return [s for s in self.stream(topics.OPERATOR_HEARTBEAT) if s.value is True]

    def lives_of(self, program: str) -> list[Life]:
        """Return the processes of a program, without duplicates that ended while an older one lived on."""
        return self._lives.get(program, [])

    @cached_property
    def _lives(self) -> dict[str, list[Life]]:
        of_programs: defaultdict[str, list[Life]] = defaultdict(list)
        for life in self.lives:
            of_programs[life.program].append(life)
        return {
            program: [life for life in lives if not any(_outlives(older, life) for older in lives)]
            for program, lives in of_programs.items()
        }

    @cached_property
    def _of_process(self) -> dict[tuple[str, int], list[Life]]:
        found: defaultdict[tuple[str, int], list[Life]] = defaultdict(list)
        for life in self.lives:
            found[life.program, life.pid].append(life)
        return found

    def effect_end(self, fault: InjectedFault) -> float:
        """Return when a fault ended, or earlier, when its target was replaced; a hang ends only then."""
        if fault.kind not in SUSPENDING:
            return fault.end
        lives = self._of_process.get((fault.target, fault.pid), [])
        end = max(fault.end, self.end) if fault.kind == "hang" and lives else fault.end
        return min([end, *(life.ended for life in lives if life.ended)])


def target_name(target: str) -> str:
    """Return the name of a target for a reader."""
    return {ALL: "(whole arm)", NO_TARGET: "(no target)"}.get(target, target)


def between(samples: Sequence[Sample], begin: float, end: float) -> Sequence[Sample]:
    """Return the samples sent from ``begin`` to ``end``, both included."""
    return samples[
        bisect_left(samples, begin, key=lambda s: s.sent) : bisect_right(samples, end, key=lambda s: s.sent)
    ]


def last_sent(samples: Sequence[Sample], time: float) -> Sample | None:
    """Return the last sample sent until a time, included; ``None`` if there is none."""
    index = bisect_right(samples, time, key=lambda s: s.sent)
    return samples[index - 1] if index else None


def running(history: History) -> Iterator[tuple[float, float]]:
    """Yield when the engines run: from each `on` until the next state, at most until the drive stops them."""
    states = history.stream(topics.ENGINES_STATE)
    stuck = [(fault.begin, fault.end) for fault in history.faults if fault.kind == STUCK_DRIVE]
    for state, following in itertools.zip_longest(states, states[1:]):
        if state.value == topics.ON:
            stop = state.sent + topics.DRIVE_TIMEOUT
            stop = next((end for begin, end in stuck if begin <= stop < end), stop)
            yield state.sent, min(following.sent if following else history.end, stop)


def gaps(times: Iterable[float], begin: float, end: float) -> Iterable[tuple[float, float]]:
    """Yield the intervals into which the sorted ``times`` divide the one from ``begin`` to ``end``."""
    last = begin
    for time in itertools.chain(times, [end]):
        if last < min(time, end):
            yield last, min(time, end)
            last = time


def merged(intervals: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the intervals in order; those that overlap are one. Those that only touch stay apart."""
    found: list[tuple[float, float]] = []
    for begin, end in sorted(intervals):
        if found and begin < found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], end))
        else:
            found.append((begin, end))
    return found


def _outlives(one: Life, two: Life) -> bool:
    """Return whether a process started before another one and ended after it."""
    later = one.ended is None or (two.ended is not None and one.ended > two.ended)
    return one.began < two.began and later
