"""The fleet: what an operator of many arms has to know of each.

User story (ours): as the operator of many arms, I see at a glance which of them needs me.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import reactivex as rx
from reactivex import Observable

from deploy.supervision.reaction import reaction
from deploy.supervision.sentinel import reported
from interfaces.limits import newest
from interfaces.service import UserError
from interfaces.service.health import Health, healths, reported_parameters
from interfaces.topics import ALIVE, DIAGNOSTICS, ENGINES_STATE, OPERATOR_ACTIVITY, Topic

HEADER = ("ARM", "DOMAIN", "HOST", "OPERATOR", "ENGINES", "HEALTH", "BOUND")
SILENT, UNKNOWN = "silent", "-"
LONGEST_SILENCE = (
    2.7  # s between two states of the engines, two conclusions `alive`, or two reports of health
)

Seen = Callable[[Topic], Observable[Any]]
"""Gives the values of a topic of an arm."""
Clock = Callable[[], float]
"""The monotonic clock [s]."""


class Timestamp(NamedTuple):
    """A value, and when it came [s, monotonic clock]."""

    value: str = ""
    at: float = -math.inf


class Arm(NamedTuple):
    """An arm as its topics show it."""

    name: str
    domain: int
    engines: Timestamp = Timestamp()
    operator: Timestamp = Timestamp()
    healths: Mapping[tuple[str, str], Health] = {}
    """The last report, by host and program."""
    states: Mapping[tuple[str, str], str] = {}
    """The state of each process as the sentinel of its host sees it, by host and program."""
    reports: Mapping[str, Any] = {}
    """The latest report of each program, as it came."""


Change = Callable[[Arm], Arm]


def fleet(arms: Iterable[Observable[Arm]]) -> Observable[Arm]:
    """Emit each arm when something of it has changed."""
    return rx.merge(*arms)


def watched(arm: Arm, seen: Seen, clock: Clock) -> Observable[Arm]:
    """Emit an arm as it is after each of its messages."""

    def engines(state: str) -> Change:
        return lambda arm: arm._replace(engines=Timestamp(state, clock()))

    def operator(activity: str) -> Change:
        return lambda arm: arm._replace(operator=Timestamp(activity, clock()))

    changes = rx.merge(
        seen(ENGINES_STATE).map(engines),
        seen(OPERATOR_ACTIVITY).map(operator),
        seen(DIAGNOSTICS).map(_health),
    )
    return changes.scan(lambda arm, change: change(arm), arm)


def _health(message: Any) -> Change:
    def change(arm: Arm) -> Arm:
        namespace = arm.name.rstrip("/")
        states = {(program.host, program.name): program.state for program in reported(message, namespace)}
        news = healths(message, namespace)
        reports = {
            program: status
            for status in message.status
            for program in news
            if status.name == f"{namespace}/{program}"
        }
        return arm._replace(
            healths=newest({**arm.healths, **{(it.host, program): it for program, it in news.items()}}),
            states=newest({**arm.states, **states}),
            reports=newest({**arm.reports, **reports}),
        )

    return change


def row(arm: Arm, now: float) -> tuple[str, ...]:
    """Return the cells of an arm; what is old is not shown as fresh.

    :param now: on the monotonic clock [s].
    """
    engines = arm.engines.value if now - arm.engines.at < LONGEST_SILENCE else SILENT
    operator = arm.operator.value
    if operator == ALIVE and now - arm.operator.at >= LONGEST_SILENCE:
        operator = ""
    hosts = {host for host, _ in present(arm, now)}
    return (
        arm.name,
        str(arm.domain),
        ", ".join(sorted(hosts)) or UNKNOWN,
        operator or UNKNOWN,
        engines,
        _in_words(arm, now),
        bound(arm),
    )


def bound(arm: Arm) -> str:
    """Return how soon the engines stop, if that follows from what the programs report."""
    try:
        within = reaction({name: reported_parameters(it) for name, it in arm.reports.items()}).off_within
    except (ArithmeticError, TypeError, ValueError, UserError):  # of another version, or not ours
        return UNKNOWN
    return f"{within:g} s" if arm.reports and math.isfinite(within) else UNKNOWN


def _in_words(arm: Arm, now: float) -> str:
    """Return the health of an arm: how many are well, or the first problem; and how many run unheard."""
    healths = present(arm, now)
    silent = {name for (_, name), health in healths.items() if now - health.heard >= LONGEST_SILENCE}
    heard = {name for _, name in healths}
    if silent == heard:
        return SILENT
    problems = {name: health.reason for (_, name), health in healths.items() if not health.ok}
    problems |= dict.fromkeys(silent, SILENT)
    hosts = {host for host, _ in healths}
    problems |= {
        name: state
        for (host, name), state in arm.states.items()
        if host in hosts and state not in ("STARTING", "RUNNING")
    }
    unheard = [
        name
        for (host, name), state in arm.states.items()
        if host in hosts and state == "RUNNING" and name not in heard
    ]
    rest = f", {len(unheard)} unheard" if unheard else ""
    if not problems:
        return f"{len(healths)} ok{rest}"
    first = min(problems)
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return f"{first}: {problems[first]}{more}{rest}"


def present(arm: Arm, now: float) -> dict[tuple[str, str], Health]:
    """Return the healths without those of silent processes that another host has replaced."""
    old = {process for process, health in arm.healths.items() if now - health.heard >= LONGEST_SILENCE}
    heard = {program for _, program in arm.healths.keys() - old}
    return {
        (host, program): health
        for (host, program), health in arm.healths.items()
        if (host, program) not in old or program not in heard
    }
