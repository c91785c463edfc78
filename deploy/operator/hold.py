"""The hold-to-run switch of the pages: which beats of a page count as a hand on the switch.

A page that is held answers every 50 ms with the newest nonce that the server has sent to it. A beat counts
only if its nonce is young by the server's own clock. Beats that waited behind a stalled connection, a stopped
process or a sleeping machine are therefore no sign of life, whatever the clock of the page says.
"""

from __future__ import annotations

import math
import secrets
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from reactivex import Observable

MAX_NONCE_AGE = 0.25  # s; also the longest gap between two beats
OTHER_PAGE = "another page holds the switch"
TOO_LATE = "the connection is too slow to hold the switch"
ELSEWHERE = "another hand has taken or released the switch"


class Press(NamedTuple):
    """A hand begins to hold the button of a page."""

    page: str
    sent: float
    """When the server sent the nonce that the page returns [s]; ``-inf`` for an unknown nonce."""


class Beat(NamedTuple):
    page: str
    sent: float
    """See :attr:`Press.sent`."""


class Release(NamedTuple):
    """A hand lets go of a page, or the page has left. Without a page: a release that concerns every page."""

    page: str = ""


Event = Press | Beat | Release


class Hold(NamedTuple):
    page: str = ""
    """The page that holds the switch; empty if no page does."""
    seen: float = -math.inf
    """When the last beat of that page counted [s]."""
    alive: bool = False
    """Whether the event is a sign of life."""
    pressed: bool = False
    """Whether the event is the press that this hold begins with."""
    refused: tuple[str, str] | None = None
    """The page whose press does not count, and why."""
    ended: tuple[str, str] | None = None
    """The page that beats although it does not hold the switch any more, and why it does not."""

    def holder(self, now: float, max_age: float = MAX_NONCE_AGE) -> str:
        """Return the page that holds the switch at a time [s]; empty after a gap in its beats."""
        return self.page if now - self.seen <= max_age else ""


def step(hold: Hold, event: Event, now: float, max_age: float = MAX_NONCE_AGE) -> Hold:
    """Return the switch after an event.

    A release, a gap between two beats or one stale beat releases the switch until the next press.

    :param now: when the event is handled, by the clock of the nonces [s].
    :param max_age: greatest age of a nonce, and longest gap between two beats [s].
    """
    holder = hold.holder(now, max_age)
    kept = Hold(holder, hold.seen if holder else -math.inf)
    match event:
        case Press(page, sent):
            if holder not in ("", page):
                return kept._replace(refused=(page, OTHER_PAGE))
            if now - sent > max_age:
                return Hold(refused=(page, TOO_LATE))
            return Hold(page, now, alive=True, pressed=not holder)
        case Beat(page, sent):
            if page != holder:
                return kept._replace(ended=(page, _loss(hold, page, now)))
            late = now - sent
            return (
                Hold(page, now, alive=True)
                if late <= max_age
                else Hold(ended=(page, _lateness(late, max_age)))
            )
        case Release(page):
            return Hold() if page in ("", holder) else kept


def _loss(hold: Hold, page: str, now: float) -> str:
    if page == hold.page:
        return f"no beat came for {1000 * (now - hold.seen):.0f} ms"
    return hold.ended[1] if hold.ended and page == hold.ended[0] else ELSEWHERE


def _lateness(age: float, max_age: float) -> str:
    """Return how late a beat came; a nonce that is forgotten is only known to be too old."""
    late = f"{1000 * age:.0f}" if age < math.inf else f"more than {1000 * max_age:.0f}"
    return f"a beat came {late} ms late"


def monotonic() -> float:
    """Return the time of a clock that nobody sets and that counts while the machine sleeps [s]."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def holds(
    events: Observable[Event],
    now: Callable[[], float],
    max_age: float = MAX_NONCE_AGE,
) -> Observable[Hold]:
    """Emit the switch after each event; see :func:`step`. ``now`` is the clock of the nonces [s]."""
    return events.scan(lambda hold, event: step(hold, event, now(), max_age), Hold())


def heartbeats(holds: Observable[Hold]) -> Observable[bool]:
    """Emit ``True`` for each sign of life of the page that holds the switch."""
    return holds.filter(lambda hold: hold.alive).map(lambda _: True)


class Nonces:
    """The nonces that were sent to one page; older ones than ``MAX_NONCE_AGE`` are forgotten."""

    def __init__(self) -> None:
        self._sent: deque[tuple[str, float]] = deque()

    def issue(self, now: float) -> str:
        """Return a new nonce that is sent now [s]."""
        while self._sent and now - self._sent[0][1] > MAX_NONCE_AGE:
            self._sent.popleft()
        nonce = secrets.token_hex(8)
        self._sent.append((nonce, now))
        return nonce

    def sent(self, nonce: str) -> float:
        """Return when a nonce was sent [s]; ``-inf`` if it is unknown or forgotten."""
        return next((at for known, at in self._sent if known == nonce), -math.inf)
