"""The people around a simulated arm: an operator, and a stranger who publishes what nobody should."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Mapping
from typing import Any

from deploy.supervision.reaction import Reaction
from interfaces import topics
from tests.chaos import babbler
from tests.chaos.testbed import sources

NAP = 1.5, 4.5  # s beyond the bound of S1: just long enough for an attack on the fail-safes
RATE = 5.0  # Hz, of each source: the least with which L2 can be checked
FLOOD_RATE = 500.0  # Hz; 25 times the rate of the switch
BABBLE_RATE = 100.0  # Hz, over all topics
PRETENCE_RATE = 10.0  # Hz
FIRST_PRESS = 0.5  # s


def operator(seed: str, length: float, reaction: Reaction) -> dict[str, Any]:
    """Return a scenario for ``length`` [s]: all values move, and an operator works and sleeps at random.

    The operator holds the switch, lets go for a moment or for a strike, hammers on it, falls asleep, and
    turns the engines on. Only the watchdog turns them off: so each stop needs a reason.
    """
    rng = random.Random(f"operator {seed}")
    pressed: list[dict[str, float]] = []
    commands: list[dict[str, Any]] = []
    now = FIRST_PRESS
    while now < length:
        for begin, end in _hold(rng, now):
            pressed.append({"from": round(begin, 3), "to": round(end, 3)})
        begin, now = now, pressed[-1]["to"]
        for _ in range(rng.randrange(1, 4)):
            at = round(rng.uniform(begin, now + 2.0), 3)
            commands.append({"at": at, "command": topics.TURN_ON})
        now += _away(rng, reaction)
    commands.sort(key=lambda command: float(command["at"]))
    return {**sources(RATE), **_lengths(seed, length), "operator": {"pressed": pressed}, "engines": commands}


def _lengths(seed: str, length: float) -> dict[str, Any]:
    """Return lengths that rarely change, in half of the scenarios: a new reader needs the last ones."""
    rng = random.Random(f"lengths {seed}")
    if rng.random() < 0.5:
        return {}
    changes = [
        {"at": float(at), "value": round(rng.uniform(1.5, 2.5), 3)} for at in range(0, int(length) + 1, 45)
    ]
    return {"l1": changes, "l2": 3.0}


def _hold(rng: random.Random, now: float) -> Iterator[tuple[float, float]]:
    """Yield when the switch is pressed, until the operator leaves it alone."""
    if rng.random() < 0.2:  # hammers
        for _ in range(rng.randrange(5, 30)):
            end = now + rng.uniform(0.02, 0.4)
            yield now, end
            now = end + rng.uniform(0.02, 0.4)
    yield now, now + rng.uniform(1.0, 60.0)


def _away(rng: random.Random, reaction: Reaction) -> float:
    """Return how long the operator leaves the switch alone: a moment, a strike, or asleep [s]."""
    moment, asleep = (0.05, 1.0), (8.0, 30.0)
    watchdog = reaction.watchdog
    strike = watchdog.silence - watchdog.sampling, watchdog.silence + 1.0
    nap = reaction.off_within + NAP[0], reaction.off_within + NAP[1]
    return rng.uniform(*rng.choice((moment, strike, asleep, nap, nap)))


def silences(scenario: Mapping[str, Any], end: float) -> Iterator[tuple[float, float]]:
    """Yield when the operator of a scenario does not press the switch [s]."""
    pressed = scenario.get("operator", {}).get("pressed", [])
    repeat = scenario.get("repeat", math.inf)
    last = 0.0
    for day in range(1 + int(end / repeat)):
        for each in pressed:
            begin = each["from"] + (day and day * repeat)
            yield last, begin
            last = begin + each["to"] - each["from"] if "to" in each else end
    yield last, max(last, end)


def flood() -> None:
    """Run a stranger's program that sends too many heartbeats until it is killed."""
    babbler.run("flood", FLOOD_RATE)


def babble() -> None:
    """Run a stranger's program that sends nonsense until it is killed."""
    babbler.run("babble", BABBLE_RATE)


def pretend() -> None:
    """Run a stranger's program that reports an operator who is not there until it is killed."""
    babbler.run("pretend", PRETENCE_RATE)


def foretell() -> None:
    """Run a stranger's program that reports an operator who is there a little later, until it is killed."""
    babbler.run("foretell", PRETENCE_RATE)
