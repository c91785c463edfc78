"""One line that shows the state of an arm: engines, hand, strikes, health, and how soon the engines stop.

It has the words of the page.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import reactivex as rx
from reactivex import Observable

from deploy.operator.engines import RENEWED
from deploy.operator.fleet import LONGEST_SILENCE, UNKNOWN, Arm, bound, present, watched
from deploy.operator.holder import Holder
from deploy.operator.strikes import Operator
from interfaces import topics
from interfaces.service.health import reported_parameters
from interfaces.topics import OFF, ON
from services import operator_watchdog

GOOD, IDLE, WARN, BAD = "good", "idle", "warn", "bad"
SEPARATOR = " · "

Part = tuple[str, str]
"""How a part of the line looks, and its text."""


class Shown(NamedTuple):
    arm: Arm
    holder: Holder = Holder()
    operator: Operator = Operator()


def shown(
    name: str,
    seen: Callable[[topics.Topic], Observable[Any]],
    watchdogs: Observable[bool],
    clock: Callable[[], float] = time.monotonic,
) -> Observable[Shown]:
    """Emit what is known of an arm after each of its messages.

    :param seen: gives the values of a topic.
    :param watchdogs: see :func:`deploy.operator.strikes.new_watchdogs`.
    """

    def appears(begins: bool) -> Callable[[Shown], Shown]:
        return lambda it: it._replace(operator=it.operator.begins_again(_strikes(it.arm) if begins else None))

    def concludes(activity: str) -> Callable[[Shown], Shown]:
        return lambda it: it._replace(operator=it.operator.concludes(activity, _strikes(it.arm), clock()))

    def beats(_: Any) -> Callable[[Shown], Shown]:
        return lambda it: it._replace(holder=it.holder.beats(clock()))

    def reports(header: Any) -> Callable[[Shown], Shown]:
        return lambda it: it._replace(holder=it.holder.reports(header.frame_id, clock()))

    arm = Arm(name, 0)
    changes: Observable[Callable[[Shown], Shown]] = rx.merge(
        watched(arm, seen, clock).map(lambda arm: lambda it: it._replace(arm=arm)),
        watchdogs.map(appears),
        seen(topics.OPERATOR_ACTIVITY).map(concludes),
        seen(topics.OPERATOR_HEARTBEAT).map(beats),
        seen(topics.OPERATOR_HAND).map(reports),
    )
    return changes.scan(lambda it, change: change(it), Shown(arm))


def _strikes(arm: Arm) -> int:
    report = arm.reports.get("operator_watchdog")
    default = operator_watchdog.DEFAULTS.strikes
    try:
        return int(reported_parameters(report).get("strikes", default)) if report else default
    except (TypeError, ValueError):  # of another version
        return default


def parts(shown: Shown, now: float, width: int = 1000) -> list[Part]:
    """Return the parts of the line that fit in a width [columns], the most important first."""
    found = [_engines(shown, now), _hand(shown, now), _strikes_left(shown.operator), _health(shown.arm, now)]
    if (within := bound(shown.arm)) != UNKNOWN:
        found.append((IDLE, f"off within {within}"))
    found = [part for part in found if part[1]]
    while found and len(text(found)) > width:
        found.pop()
    return found


def text(parts: Sequence[Part]) -> str:
    return SEPARATOR.join(words for _, words in parts)


def _engines(shown: Shown, now: float) -> Part:
    state, at = shown.arm.engines
    if now - at > RENEWED or state not in (ON, OFF):
        return WARN, "Engines: unknown"
    return (GOOD if state == ON else IDLE), f"Engines {state}"


def _hand(shown: Shown, now: float) -> Part:
    return (IDLE if shown.holder.name(now) is None else GOOD), shown.holder.words(now)


def _strikes_left(operator: Operator) -> Part:
    left = operator.strikes_left
    if left is None:
        return IDLE, ""
    return (BAD if left == 0 else WARN if left == 1 else IDLE), f"{left} strike{'s' * (left != 1)} left"


def _health(arm: Arm, now: float) -> Part:
    healths = present(arm, now)
    ill = sorted(name for (_, name), it in healths.items() if not it.ok or now - it.heard >= LONGEST_SILENCE)
    if not healths:
        return IDLE, ""
    words = f"{len(healths) - len(ill)} of {len(healths)} ok"
    return (BAD, f"{words} ({', '.join(ill)})") if ill else (GOOD, words)
