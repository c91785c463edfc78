"""Fingers on the sliders: along the page they scroll, across they move a joint."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

from tests.system.sites import LIMIT

from .arm import Arm
from .chromium import Fingers, HandOnPage

pytestmark = pytest.mark.timed

PHONE = {"width": 390, "height": 844}
STEPS = 15
FAR = 200  # px


class Finger:
    """A finger on the slider of the first joint."""

    def __init__(self, hand: HandOnPage) -> None:
        self.hand = hand
        self._fingers = Fingers(hand.page)

    def move(self, across: float, along: float) -> None:
        """Touch the slider beside its thumb, move, and lift; [px]."""
        box = self.hand.page.locator("#set-theta1").bounding_box()
        x, y = box["x"] + box["width"] * 0.2, box["y"] + box["height"] / 2
        for step in range(STEPS + 1) if across or along else (0,):
            self._fingers.put(0, (x + across * step / STEPS, y + along * step / STEPS))
        self._fingers.lift()
        self.hand.await_drawing()

    def joints_set(self) -> set[str]:
        """Return the joints that the page has set, once it has sent what comes after that."""
        field = self.hand.page.locator("#number-theta2")
        field.fill("0.1")
        field.press("Enter")
        self.hand.page.wait_for_selector("#source-theta2[data-source=hand]")
        names = self.hand.page.evaluate("sent.filter((it) => it.type === 'set').map((it) => it.name)")
        return set(names) - {"theta2"}


@pytest.fixture
def finger(arm: Arm, browser: Any) -> Iterator[Finger]:
    with closing(browser.new_context(has_touch=True, is_mobile=True, viewport=PHONE)) as context:
        hand = HandOnPage(context, arm.url)
        hand.page.wait_for_selector("#set-theta1:enabled")
        hand.page.evaluate("document.getElementById('set-theta1').scrollIntoView({ block: 'center' })")
        yield Finger(hand)
        hand.await_live()
        for _ in range(2):  # as a screen reader does, which cannot hold
            hand.page.evaluate("document.getElementById('follow-scenario').click()")
        for joint in ("theta1", "theta2"):
            hand.page.wait_for_selector(f"#source-{joint}[data-source=scenario]")


def test_finger_that_scrolls_moves_no_joint(finger: Finger) -> None:
    page = finger.hand.page
    before, top = page.input_value("#set-theta1"), page.evaluate("scrollY")
    finger.move(across=0, along=-FAR)
    deadline = time.monotonic() + LIMIT
    while page.evaluate("scrollY") == top:
        assert time.monotonic() < deadline, "the page does not scroll"
        page.wait_for_timeout(20)
    assert finger.joints_set() == set()
    assert page.input_value("#set-theta1") == before


def test_finger_that_could_not_scroll_moves_no_joint(finger: Finger) -> None:
    finger.hand.page.evaluate("document.documentElement.style.overflow = 'hidden'")
    finger.move(across=FAR / 4, along=-FAR)
    assert finger.joints_set() == set()


def test_finger_that_moves_across_moves_a_joint(finger: Finger) -> None:
    finger.move(across=FAR, along=-FAR / 4)
    assert finger.joints_set() == {"theta1"}


def test_tap_sets_a_joint(finger: Finger) -> None:
    finger.move(across=0, along=0)
    assert finger.joints_set() == {"theta1"}
