"""What a hand does with keyboard and focus, on a real X server; see desktop.py."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager

import pytest

from interfaces import topics

from .arm import GONE, Arm, hold_with_engines_on, undisturbed
from .chromium import PAD
from .desktop import RETURN, SPACE, Desktop, HandAtDesktop, hand_at_desktop

pytestmark = pytest.mark.timed

LONGER = 4.0  # s: a key without repeats is released after 3 s
UNSEEN = 2.0  # s within which the page notices that a key repeats no more
UNFOCUSED = "Released: the window lost focus."
HIDDEN = "Released: the page was hidden."
KEYS = pytest.mark.parametrize("key", [SPACE, RETURN], ids=["space", "return"])


@pytest.fixture(scope="module")
def shared(arm: Arm) -> Iterator[HandAtDesktop]:
    with hand_at_desktop(arm.url, PAD) as hand:
        yield hand


@pytest.fixture
def hand(shared: HandAtDesktop) -> HandAtDesktop:
    shared.start_over()
    return shared


def key_of(hand: HandAtDesktop, key: int) -> tuple[Callable[[], None], Callable[[], None]]:
    return lambda: hand.desktop.press(key), lambda: hand.desktop.lift(key)


@KEYS
@undisturbed
def test_key_holds_while_it_repeats_and_releases_when_lifted(arm: Arm, hand: HandAtDesktop, key: int) -> None:
    down, up = key_of(hand, key)
    hold_with_engines_on(arm, hand, down, up)
    begin = time.time()
    time.sleep(LONGER)
    arm.record.await_beats(begin + LONGER)
    assert hand.state == "held"
    up()
    hand.await_state("released")
    arm.record.silence_after(time.time())
    assert hand.why == ""


@KEYS
@pytest.mark.parametrize("thief", [Desktop.hotkey, Desktop.grab], ids=["hotkey", "grab"])
@undisturbed
def test_key_that_is_lifted_unseen_is_released(
    arm: Arm, hand: HandAtDesktop, thief: Callable[[Desktop], AbstractContextManager[None]], key: int
) -> None:
    down, up = key_of(hand, key)
    hand.hold(down, up)
    time.sleep(1.0)  # it repeats
    with thief(hand.desktop):
        up()
        lifted = time.time()
    arm.record.silence_after(lifted + UNSEEN)
    assert hand.why == "Released: the key does not repeat any more."


@undisturbed
def test_keyboard_alone_holds_and_turns_the_engines_on(arm: Arm, hand: HandAtDesktop) -> None:
    down, up = key_of(hand, SPACE)
    hand.hold(down, up)
    arm.record.await_beats(time.time(), 12)  # the watchdog samples every 500 ms
    hand.page.wait_for_selector("#operator[data-state=seen]")  # the controller needs a presence
    hand.tab_to("#turn-on")
    hand.desktop.press(RETURN)
    hand.desktop.lift(RETURN)
    hand.page.wait_for_selector("#engines[data-state=on]")
    assert arm.record.states[-1].engines == topics.ON
    time.sleep(LONGER)
    assert hand.state == "held", "only the last key repeats"
    up()
    hand.await_state("released")
    arm.record.silence_after(time.time())
    assert not hand.stalled


@undisturbed
def test_window_that_loses_focus_releases(arm: Arm, hand: HandAtDesktop) -> None:
    hold_with_engines_on(arm, hand)
    with hand.desktop.other_window():
        arm.record.silence_after(time.time() + GONE)
    assert hand.why == UNFOCUSED


@undisturbed
def test_tab_that_gives_way_to_another_releases(arm: Arm, hand: HandAtDesktop) -> None:
    hold_with_engines_on(arm, hand)
    show_again = hand.page.show_other_tab()
    arm.record.silence_after(time.time() + GONE)
    assert hand.page.evaluate("document.visibilityState") == "hidden"
    show_again()
    hand.until("document.visibilityState === 'visible'")
    hand.await_drawing()
    assert hand.why in (UNFOCUSED, HIDDEN)  # the first sign; Chromium gives them in either order


@undisturbed
def test_gamepad_holds_no_page_in_the_background(arm: Arm, hand: HandAtDesktop) -> None:
    hand.page.evaluate("announce('gamepadconnected')")
    time.sleep(0.2)
    with hand.desktop.other_window():
        hand.until("!document.hasFocus()")
        hand.page.evaluate("pad.buttons[7].value = 1")
        time.sleep(0.5)
        assert hand.state == "released"
    hand.page.evaluate("pad.buttons[7].value = 0")
    time.sleep(0.2)
    hand.hold(lambda: hand.page.evaluate("pad.buttons[7].value = 1"))
