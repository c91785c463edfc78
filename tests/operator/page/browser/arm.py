"""An arm with a page, as `make start` starts it, and a hand that holds it."""

from __future__ import annotations

import functools
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.ports import free_port
from tests.system.sites import STEADY, Site

from .chromium import HandOnPage
from .record import Record

LINK = "127.0.0.2"  # where a test may listen between page and server
ATTEMPTS = 5
GONE = 0.25 + 0.1  # s for which a beat on its way may count: the age of its nonce, and the way to the topic


class Arm:
    """A running system in which nothing moves and nobody holds the switch."""

    def __init__(self, run: Path, domain: int, scenario: str = STEADY, **page: object) -> None:
        self.site = Site(run, domain)
        self.port = free_port()
        page = {"port": self.port} | page
        parameters = run.with_suffix(".yaml")
        lines = "".join(f"\n    {name}: {value}" for name, value in page.items())
        parameters.write_text(f"operator_page:\n  ros__parameters:{lines}\n")
        code, printed = self.site.do("start", scenario, str(parameters))
        assert code == 0, printed
        found = re.fullmatch(r"The page: (\S+)\n", (run / "settings" / "page.txt").read_text())
        assert found
        self.url = found[1]
        """The address of the page."""
        self.record = Record(domain)

    def close(self) -> None:
        self.record.close()
        self.site.close()


def hold_with_engines_on(arm: Arm, hand: HandOnPage, *hands: Callable[[], None]) -> None:
    """Hold until the engines are on and heartbeats flow then; ``hands`` as of :meth:`HandOnPage.hold`.

    A machine that stands still may end a hold at any time: it begins again.
    """

    def is_held() -> bool:
        return hand.state == "held"

    while True:
        hand.hold(*hands)
        arm.record.turn_on(is_held)
        on = time.time()
        arm.record.until(lambda on=on: len(arm.record.beats_after(on)) >= 3 or not is_held(), period=0.05)
        if is_held():
            return


def undisturbed(test: Callable[..., None]) -> Callable[..., None]:
    """Begin a test of a ``hand`` again if the page had to release because the machine stood still."""

    @functools.wraps(test)
    def attempts(hand: HandOnPage, **others: Any) -> None:
        for _ in range(ATTEMPTS):
            try:
                return test(hand=hand, **others)
            except Exception:
                if not hand.stalled:
                    raise
            hand.start_over()
        pytest.skip(f"platform: the machine stood still in each of {ATTEMPTS} attempts")

    return attempts
