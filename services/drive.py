"""The drive of the virtual joints: it moves them while the engines are on (deploy/SAFETY.md, A1).

User story (ours): as a robot operator, I see the arm stand still when the engines go off, and go on from
there when I turn them on again.

In a scenario with a drive, the joints play their tracks by the driven time. It is a time, not angles: both
joints agree on it, and each remains what sets its joint. It is kept as settings are, in memory, on no disk,
so a restart moves no joint; while it cannot be kept, it stands still. It names its host, for a joint follows
the drive of its own host only. An `on` counts only if no `off` came within 400 ms before it: of two
controllers (two hosts that were cut from each other), none moves the joints against the other.
"""

from __future__ import annotations

import socket
from collections.abc import Callable
from datetime import datetime
from functools import partial

import reactivex as rx
from reactivex import Observable

from interfaces import service
from interfaces.permission import NEVER, EngineState, engine_states, unopposed
from interfaces.service import ServiceNode, host
from interfaces.service.epoch import Epoch
from interfaces.sources.player import Player
from interfaces.sources.settings import Settings
from interfaces.topics import DRIVEN_TIME, ON, DrivenTime

LONGEST_STEP = 2  # periods: after a pause, the joints do not jump


def driven_time(
    states: Observable[EngineState], begin: float, period: float, keep: Callable[[float], bool]
) -> Observable[float]:
    """Emit every ``period`` [s] the driven time [s]: it passes while an unopposed ``on`` counts.

    :param begin: the driven time at the beginning.
    :param keep: keeps a time for the next process, and returns whether it did. A time that is not kept does
        not pass: the joints would jump back when the drive restarts.
    """

    def accepted_until(state: EngineState) -> datetime:
        return state.young_until if state.name == ON else NEVER

    def step(time: float, tick: tuple[tuple[datetime, float], datetime]) -> float:
        (now, passed), until = tick
        then = time + min(passed, LONGEST_STEP * period) if now < until else time
        return then if keep(then) else time

    ticks = rx.interval(period).time_interval().timestamp()
    passing = ticks.map(lambda it: (it.timestamp, it.value.interval.total_seconds()))
    return passing.with_latest_from(unopposed(states).map(accepted_until).start_with(NEVER)).scan(step, begin)


def wire(node: ServiceNode) -> None:
    epoch = Epoch(node)
    player, settings = Player(node, epoch), Settings(node, is_restart=epoch.is_past)
    rate = player.scenario.drive
    if rate is None:
        return
    begin, keep = settings.recall("time", 0.0), partial(settings.remember, "time")
    times = driven_time(engine_states(node), begin, 1.0 / rate, keep)
    clock, source, name = node.get_clock(), host.identity(), socket.gethostname()
    driven = times.map(lambda seconds: DrivenTime(clock.now().nanoseconds, seconds, source, name))
    node.publish(DRIVEN_TIME, epoch.start(driven))


if __name__ == "__main__":
    service.run("drive", wire)
