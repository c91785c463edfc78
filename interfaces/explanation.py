"""Why the engines are as they are: follows the turns of their latch, and who sent its commands."""

from __future__ import annotations

from datetime import datetime
from typing import Any, NamedTuple

import reactivex as rx
from reactivex import Observable

from interfaces import cause, topics
from interfaces.cause import PAUSED, STARTED, UNSEEN, Cause
from interfaces.latch import REFUSED, Command, Tick, Turn
from interfaces.permission import NEVER
from interfaces.service import Rejected, ServiceNode
from interfaces.topics import DRIVE_TIMEOUT, OFF, ON


class Sender(NamedTuple):
    """The sender of the last command."""

    sent: datetime  # the source time: after that of the command
    command: str
    node: str


class Explained(NamedTuple):
    """Why the engines are as they are, since when, what was last commanded, and what to emit."""

    cause: Cause = Cause(OFF, STARTED)
    at: datetime = NEVER
    decided: datetime = NEVER  # the source time of the command that decided
    commanded: datetime = NEVER  # that of the last command
    is_new: bool = True
    output: Cause | None = None


def explain(known: Explained, news: Turn | Sender) -> Explained:
    """Return why the engines are as they are after a turn, or with the name of a command's sender.

    The name comes after its command. It counts if no other command came between. The cause is emitted by the
    next tick: neither what floods the commands nor a slow display delays the state.
    """
    known = known._replace(output=None) if known.output else known
    if isinstance(news, Sender):
        is_of_last = known.decided == known.commanded <= news.sent
        if not is_of_last or known.cause.event != news.command or known.cause.sender:
            return known
        return known._replace(cause=known.cause._replace(sender=news.node), is_new=True)
    event, before, after = news
    commanded = event.sent if isinstance(event, Command) else NEVER
    if before.engines != after.engines:
        known = Explained(_cause(news), event.at, commanded)
    if isinstance(event, Command):
        known = known._replace(commanded=commanded)
        for refusal in (it.reason for it in after.outputs if isinstance(it, Rejected)):
            why = refusal.removeprefix(REFUSED)
            known = known._replace(cause=known.cause._replace(refused=why), is_new=True)
    if isinstance(event, Tick) and known.is_new:
        at = event.at if known.at == NEVER else known.at
        since = (event.at - at).total_seconds()
        return known._replace(at=at, is_new=False, output=known.cause._replace(since=since))
    return known


def _cause(turn: Turn) -> Cause:
    event, before, after = turn
    if isinstance(event, Command) and (event.name == topics.TURN_OFF or after.engines == ON):
        return Cause(after.engines, event.name, age=event.age)
    unseen, paused = before.ages(event.at)
    # A controller that stood still for longer finds the operator unseen as well.
    return Cause(OFF, PAUSED, age=paused) if paused > DRIVE_TIMEOUT else Cause(OFF, UNSEEN, age=unseen)


def engine_causes(turns: Observable[Turn], senders: Observable[Sender]) -> Observable[Cause]:
    """Emit why the engines are as they are, with the tick after each change."""
    explained = rx.merge(turns, senders).scan(explain, Explained())
    return explained.map(lambda it: it.output).filter(lambda it: it is not None)


def contained(causes: Observable[Any]) -> Observable[Any]:
    """Emit the causes until an error, which is reported: it ends them, not the controller."""
    return causes.catch(
        lambda error, _: rx.concat(
            rx.of(Rejected(topics.ENGINES_CAUSE, f"not published: {error!r}")), rx.never()
        )
    )


def publish_causes(node: ServiceNode, turns: Observable[Turn]) -> None:
    """Publish why the engines are as they are."""
    senders = node.observe(topics.ENGINES_SENDER, timestamped=True)
    causes = engine_causes(turns, senders.map(lambda it: Sender(it.timestamp, *it.value)))
    node.publish(topics.ENGINES_CAUSE, contained(causes.map(cause.message)))
