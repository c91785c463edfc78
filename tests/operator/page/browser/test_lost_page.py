"""Page, browser, program or link is lost while a hand holds the arm with the engines on.

The heartbeats must stop and must not come back until the next press. That the engines are off in time (S1) is
measured once here: what follows the last heartbeat is the same in all cases.
"""

from __future__ import annotations

import os
import signal
import time
from contextlib import closing
from itertools import pairwise
from typing import Any

import pytest

from tests.system.sites import LIMIT

from . import chromium
from .arm import GONE, LINK, Arm, hold_with_engines_on, undisturbed
from .chromium import HandOnPage
from .link import Link

pytestmark = pytest.mark.timed

S1 = 10.5  # s
HELD_UP = 2.0  # s
LATE = 0.4  # s for which a page goes on: the server still talks to it


def test_engines_stop_in_time_after_the_browser_is_killed(arm: Arm, own_browser: Any) -> None:
    hand = HandOnPage(own_browser.new_context(), arm.url)
    pids = chromium.processes_of(own_browser)
    hold_with_engines_on(arm, hand)
    chromium.signal_all(pids, signal.SIGKILL)
    killed = time.time()
    arm.record.silence_after(killed + GONE)
    last = arm.record.beats[-1]
    off = arm.record.await_off(killed)
    print(
        f"browser killed: last heartbeat after {last - killed:.3f} s, engines off after {off - killed:.3f} s"
    )
    assert off - last <= S1


def test_suspended_browser_releases_and_resumes_released(arm: Arm, own_browser: Any) -> None:
    hand = HandOnPage(own_browser.new_context(), arm.url)
    pids = chromium.processes_of(own_browser)
    hold_with_engines_on(arm, hand)
    try:
        chromium.signal_all(pids, signal.SIGSTOP)
        stopped = time.time()
        arm.record.silence_after(stopped + GONE, 1.5)
    finally:
        chromium.signal_all(pids[::-1], signal.SIGCONT)
    arm.record.silence_after(stopped + GONE, 3.0)
    hand.await_state("released")
    last = max(arm.record.beats)
    print(f"suspended: last heartbeat after {last - stopped:.3f} s")
    hand.up()
    hand.hold()


def test_killed_program_releases_and_comes_back_released(arm: Arm, hand: HandOnPage) -> None:
    hold_with_engines_on(arm, hand)
    process = arm.site.members["operator_page"]
    page = hand.page.get_attribute("html", "data-page")
    os.kill(process, signal.SIGKILL)
    killed = time.time()
    hand.page.wait_for_selector(f"html[data-connection=live]:not([data-page='{page}'])")
    hand.await_state("released")
    arm.record.silence_after(killed, time.time() - killed + 0.5)
    assert arm.site.members["operator_page"] != process
    hand.up()
    hold_with_engines_on(arm, hand)  # the open page finds the new process


def test_stopped_program_releases_and_resumes_released(arm: Arm, hand: HandOnPage) -> None:
    hold_with_engines_on(arm, hand)
    process = arm.site.members["operator_page"]
    arm.record.await_beats(time.time())
    os.kill(process, signal.SIGSTOP)
    try:
        stopped = time.time()
        hand.page.wait_for_selector("html[data-connection=lost]")
        arm.record.silence_after(stopped, HELD_UP)
    finally:
        os.kill(process, signal.SIGCONT)
    hand.await_live()
    hand.await_state("released")
    arm.record.silence_after(stopped, HELD_UP + 1.0)
    hand.up()
    hand.hold()


@undisturbed
def test_hand_survives_the_death_of_other_programs(arm: Arm, hand: HandOnPage) -> None:
    for program in ("dead_mans_switch", "dead_mans_switch", "operator_watchdog", "sentinel", "config_l1"):
        hold_with_engines_on(arm, hand)
        pid = arm.site.members[program]
        os.kill(pid, signal.SIGKILL)
        killed = time.time()
        arm.site.await_members(lambda members, pid=pid, program=program: members.get(program, pid) != pid)
        time.sleep(1.0)
        beats = arm.record.beats_after(killed - 0.2)
        assert max(later - earlier for earlier, later in pairwise(beats)) <= 0.25, program
        assert hand.state == "held", program
        hand.up()


def test_queued_beats_count_for_nothing(arm: Arm, browser: Any, link: Link) -> None:
    with closing(browser.new_context()) as context:
        hand = HandOnPage(context, arm.url.replace("127.0.0.1", LINK), chromium.STUBBORN)
        hold_with_engines_on(arm, hand)
        hand.page.evaluate("beStubborn()")
        link.hold_up_page()
        held_up, before = time.time(), hand.sent("beat")
        arm.record.silence_after(held_up + GONE, HELD_UP)
        queued = hand.sent("beat") - before
        link.mend()
        # The page goes on to beat, and gets new nonces: only another press may hold.
        arm.record.silence_after(held_up + GONE, HELD_UP + 1.5)
        beats = hand.sent("beat") - before
        print(f"{queued} beats let loose after {HELD_UP} s, then {beats - queued} with new nonces")
        assert queued >= 10
        assert beats > queued


def test_page_is_told_that_its_beats_came_too_late(arm: Arm, browser: Any, link: Link) -> None:
    with closing(browser.new_context()) as context:
        hand = HandOnPage(context, arm.url.replace("127.0.0.1", LINK))
        hold_with_engines_on(arm, hand)
        link.hold_up_page()
        held_up = time.time()
        time.sleep(LATE)
        link.mend()
        hand.await_state("released")
        arm.record.silence_after(held_up + GONE)
        assert hand.stalled, hand.why
        hand.up()
        hand.hold()


@pytest.mark.parametrize("part", ["dom.js", "main.js", "base.css"])
def test_page_loads_again_until_each_part_has_arrived(arm: Arm, browser: Any, part: str) -> None:
    refused: list[str] = []

    def refuse_twice(route: Any) -> None:
        if len(refused) == 2:
            route.continue_()
        else:
            refused.append(route.request.url)
            route.abort("internetdisconnected")

    with closing(browser.new_context()) as context:
        context.route(f"**/static/{part}", refuse_twice)
        hand = HandOnPage(context, arm.url)
        deadline = time.monotonic() + LIMIT
        while len(refused) < 2:  # a page without a style is live at once
            assert time.monotonic() < deadline
            hand.page.wait_for_timeout(50)
        hand.await_live()
