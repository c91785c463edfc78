"""Two controllers of one arm, as after a start on two hosts that were cut from each other: their recipes.

The recipes of both and of the drive run in virtual time, amid hosts and a network that fail as they may.
tests/simulation/test_two_controllers.py has whole processes, and a tenth of the speed.

    deploy/commands/venv.sh -m tests.component.test_two_controllers 1000

simulates 1,000 hours, and says as it goes on how often the controllers contradicted each other.
"""

from __future__ import annotations

import random
import sys
from bisect import bisect
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import Any, NamedTuple

import pytest
from reactivex import Observable, Subject
from reactivex.abc import DisposableBase
from reactivex.disposable import Disposable, SerialDisposable
from reactivex.scheduler import CurrentThreadScheduler, VirtualTimeScheduler
from reactivex.scheduler.scheduler import Scheduler

from interfaces.latch import Command, Presence
from interfaces.permission import NEVER, EngineState
from interfaces.topics import CLOCK_TOLERANCE, DRIVE_TIMEOUT, OFF, ON, TURN_OFF, TURN_ON
from services import drive
from services.engine_controller import Parameters, engine_state, turns

LENGTH = 300.0  # s of an experiment
REPORT = 12  # experiments, an hour
HOSTS = ROBOT, CONTROL = 0, 1
SEEN = 0.5  # s from a presence to the next
LOST = 0.05  # of the messages
LATEST = 0.5  # s of a message at most; three of four take less than 2 ms


class Fight(NamedTuple):
    contradictions: int
    """How often the drive heard a state less than 400 ms after the other controller said the opposite."""
    moved: float
    """For how long the drive moved the joints [s]."""
    against: list[float]
    """When it moved them though it had heard an `off` that was said within the last 400 ms."""


class Time(VirtualTimeScheduler):
    def __init__(self) -> None:
        super().__init__(_date(0.0))

    @property
    def seconds(self) -> float:
        return self.now.timestamp()

    def at(self, seconds: float, act: Callable[[], None]) -> None:
        self.schedule_absolute(_date(seconds), lambda *_: act())


class Stopped(Scheduler):
    """The scheduler of a process that is stopped for some spells: what is due then waits for their end."""

    def __init__(self, time: Time, spells: list[float]) -> None:
        super().__init__()
        self._time, self._spells = time, spells

    @property
    def now(self) -> datetime:
        return self._time.now

    def schedule(self, action: Any, state: Any = None) -> DisposableBase:
        return self.schedule_absolute(self.now, action, state)

    def schedule_relative(self, duetime: Any, action: Any, state: Any = None) -> DisposableBase:
        return self.schedule_absolute(self.now + self.to_timedelta(duetime), action, state)

    def schedule_absolute(self, duetime: Any, action: Any, state: Any = None) -> DisposableBase:
        due = duetime.timestamp()
        if _is_within(self._spells, due):
            duetime = _date(self._spells[bisect(self._spells, due)])
        return self._time.schedule_absolute(duetime, lambda *_: action(self, state))


class Line:
    """From one program to another: messages are late, lost or cut off, but overtake none."""

    def __init__(self, time: Time, chance: random.Random, end: Scheduler, cuts: list[float]) -> None:
        self._time, self._chance, self._end, self._cuts = time, chance, end, cuts
        self._last = 0.0

    def send(self, hear: Callable[..., None], *message: Any) -> None:
        if self._chance.random() > LOST and not _is_within(self._cuts, self._time.seconds):
            self._last = max(self._last, self._time.seconds + LATEST * self._chance.random() ** 20)
            self._end.schedule_absolute(_date(self._last), lambda *_: hear(*message))


class Controller:
    """It is stopped, and killed and started again: its successor is not known at once."""

    def __init__(self, time: Time, chance: random.Random, clock: float, say: Callable[[str], None]) -> None:
        self.process = Stopped(time, _spells(chance, (5.0, 60.0), (0.05, 5.0)))
        self._time, self._clock, self._say = time, clock, say
        self._commands, self._presences = Subject[Command](), Subject[Presence]()
        given = Parameters(repeat=chance.uniform(0.1, 0.2))
        self._states = engine_state(turns(self._commands, self._presences, given))
        self._life = SerialDisposable()
        lives = [0.0, *_spells(chance, (5.0, 60.0), (0.1, 3.0))]
        for begin, end in zip(lives[::2], lives[1::2], strict=False):
            time.at(begin, partial(self._start, begin + chance.random()))
            time.at(end, lambda: self._life.set_disposable(Disposable()))

    def command(self, name: str, stamp: float) -> None:
        self._commands.on_next(Command(self._time.now, self._age(stamp), name))

    def see(self, stamp: float) -> None:
        self._presences.on_next(Presence(self._time.now, self._age(stamp)))

    def _age(self, stamp: float) -> float:
        return self._time.seconds + self._clock - stamp

    def _start(self, known: float) -> None:
        def on_next(state: Any) -> None:
            if state in (ON, OFF) and self._time.seconds >= known:
                self._say(state)

        self._life.disposable = self._states.subscribe(on_next, scheduler=self.process)


def fight(seed: str) -> Fight:
    """Let two controllers command one drive, while the line between their hosts is cut and heals."""
    chance, time = random.Random(f"two controllers {seed}"), Time()
    clocks = 0.0, chance.uniform(-CLOCK_TOLERANCE, CLOCK_TOLERANCE)  # ahead of that of the drive [s]
    cuts = [_spells(chance, (5.0, 40.0), (0.2, 20.0)) for _ in HOSTS]  # of the way from each host
    pressed = _spells(chance, (0.5, 15.0), (10.0, 40.0))
    last = [(OFF, -1.0)] * 2
    offs = [-1.0] * 2
    contradictions, driven = 0, 0.0
    against: list[float] = []
    heard = Subject[EngineState]()

    def line(of: int, to: int, end: Scheduler) -> Line:
        return Line(time, chance, end, cuts[of] if of != to else [])

    def hear(host: int, state: str, said: float) -> None:
        nonlocal contradictions
        last[host] = state, said
        if state == OFF:
            offs[host] = said
        other, at = last[1 - host]
        contradictions += state != other and time.seconds < at + DRIVE_TIMEOUT
        heard.on_next(EngineState(state, time.now, time.seconds - said - clocks[host]))

    def move(after: float) -> None:
        nonlocal driven
        if after > driven and time.seconds < max(offs) + DRIVE_TIMEOUT:
            against.append(time.seconds)
        driven = after

    def see() -> None:
        time.at(time.seconds + SEEN, see)
        if _is_within(pressed, time.seconds):
            for host in HOSTS:
                lines[CONTROL][host].send(controllers[host].see, time.seconds + clocks[CONTROL])

    def command() -> None:
        time.at(time.seconds + chance.uniform(1.0, 10.0), command)
        name, of = chance.choice([TURN_ON, TURN_ON, TURN_OFF]), chance.choice(HOSTS)
        for host in HOSTS:
            lines[of][host].send(controllers[host].command, name, time.seconds + clocks[of])

    def controller(host: int) -> Controller:
        to_drive = line(host, ROBOT, time)
        return Controller(
            time, chance, clocks[host], lambda state: to_drive.send(hear, host, state, time.seconds)
        )

    controllers = [controller(host) for host in HOSTS]
    lines = [[line(of, host, controllers[host].process) for host in HOSTS] for of in HOSTS]
    times = drive.driven_time(heard, 0.0, chance.uniform(0.04, 0.2), keep=lambda _: True)
    times.subscribe(move, scheduler=time)
    see()
    command()
    # Within an action of this scheduler, a subscription costs RxPY less.
    CurrentThreadScheduler.singleton().schedule(lambda *_: time.advance_to(_date(LENGTH)))
    return Fight(contradictions, driven, against)


def _date(seconds: float) -> datetime:
    return datetime.fromtimestamp(seconds, UTC)


def _spells(chance: random.Random, gap: tuple[float, float], length: tuple[float, float]) -> list[float]:
    """Return the begin and the end of each of some spells, in turn."""
    bounds = [0.0]
    while bounds[-1] < LENGTH:
        begin = bounds[-1] + chance.uniform(*gap)
        bounds += [begin, begin + chance.uniform(*length)]
    return bounds[1:]


def _is_within(bounds: list[float], time: float) -> bool:
    return bisect(bounds, time) % 2 == 1


def test_no_controller_moves_the_joints_against_another() -> None:
    found = fight("1")
    assert found.contradictions > 100
    assert found.moved > 10.0
    assert found.against == []


def vetoless(states: Observable[EngineState]) -> Observable[EngineState]:
    return states


def forgetful(states: Observable[EngineState]) -> Observable[EngineState]:
    """Forget an `off` when an `on` comes: only the first `on` has to wait."""

    def step(before: EngineState, state: EngineState) -> EngineState:
        return state._replace(off=before.at if before.name == OFF else NEVER)

    wait = timedelta(seconds=DRIVE_TIMEOUT)
    return states.scan(step).filter(lambda state: state.name == OFF or state.at >= state.off + wait)


@pytest.mark.parametrize("bug", [vetoless, forgetful])
def test_drive_that_obeys_any_controller_is_found(bug: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drive, "unopposed", bug)
    assert fight("1").against


def main(hours: float) -> int:
    """Simulate; return the exit code."""
    contradictions, moved, against = 0, 0.0, 0
    for number in range(1, round(hours * 3600.0 / LENGTH) + 1):
        found = fight(str(number))
        contradictions, moved = contradictions + found.contradictions, moved + found.moved
        against += len(found.against)
        if number % REPORT == 0:
            print(
                f"{number * LENGTH / 3600.0:g} h: {contradictions} contradictions, {moved:.0f} s moved, "
                f"{against} times against a controller",
                flush=True,
            )
    return int(bool(against))


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1])))
