"""The page in a browser: reachable by keyboard and screen reader, strict, in every width, never stale."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from std_msgs.msg import Float64

from deploy.supervision import manifest
from interfaces import topics
from tests.system.sites import LIMIT, Peer

from .arm import LINK, Arm, hold_with_engines_on
from .chromium import HandOnPage
from .link import Link

pytestmark = pytest.mark.timed

WIDTHS = {320: 568, 390: 844, 844: 390, 1280: 800, 3840: 2160}
TARGET = 44  # px
LEGIBLE = 11  # px, the height of the letters' box
CONTROLS = ("button", "slider", "spinbutton")
NAMED = (*CONTROLS, "link", "textbox", "image", "table", "region")
WAIT = 1000 * LIMIT  # ms
TABS = 100  # more than the page has stops
GREY = 0.5  # s
SAMPLES = 5

TIMING = """
let heard = 0, late = 0, ticked = performance.now();
window.greyed = [];
setInterval(() => {
    const now = performance.now();
    late += Math.max(0, now - ticked - 20);
    ticked = now;
}, 10);
const request = window.requestAnimationFrame;
window.requestAnimationFrame = (draw) => {
    const asked = performance.now();
    return request((now) => {
        late += Math.max(0, performance.now() - asked - 20);
        draw(now);
    });
};
window.WebSocket = class extends WebSocket {
    constructor(...options) {
        super(...options);
        this.addEventListener("message", () => { heard = performance.now(); late = 0; });
    }
};
addEventListener("DOMContentLoaded", () => new MutationObserver(() => {
    const isLost = document.documentElement.dataset.connection === "lost";
    const now = performance.now(); // after a standstill, the timer above may not have run yet
    if (isLost) greyed.push([now - heard, late + Math.max(0, now - ticked - 20)]);
}).observe(document.documentElement, { attributeFilter: ["data-connection"] }));
"""
"""Notes how long after the last message the page turned grey, and how late timers and frames were [ms]."""

BEYOND = """
[...document.querySelectorAll("body *")].filter((it) =>
    it.checkVisibility() && !it.closest("svg, .hidden, .skip")
    && it.getBoundingClientRect().right > document.documentElement.clientWidth + 1
).map((it) => `${it.tagName} ${it.id} ${it.className}`)
"""
"""The elements that reach beyond the right edge, even where they are cut off."""

SMALL = """
(least) => [...document.querySelectorAll("button, input, a")].filter((it) =>
    it.checkVisibility() && !it.matches(".skip")
).map((it) => [it.id || it.ariaLabel || it.textContent, it.getBoundingClientRect()]).filter(
    ([, { width, height }]) => Math.min(width, height) < least - 0.5
).map(([name, { width, height }]) => `${name} ${width} ${height}`)
"""
"""The controls that are smaller than a size [px]."""

INLINE = """
window.violations = [];
document.addEventListener("securitypolicyviolation", (event) => violations.push(event.effectiveDirective));
const script = document.createElement("script");
script.textContent = "window.ran = true;";
document.head.append(script);
document.body.insertAdjacentHTML("beforeend", "<img src='http://127.0.0.1:9/' onerror='window.ran = true'>");
fetch("http://127.0.0.1:9/").catch(() => {});
"""


@pytest.fixture(scope="module")
def shared(arm: Arm, browser: Any) -> Any:
    """A page that shows the arm; the tests leave it as it was."""
    with closing(browser.new_context()) as context:
        hand = HandOnPage(context, arm.url)
        hand.page.wait_for_selector("tr[data-process=kinematics][data-ok=yes]")
        yield hand


@pytest.mark.parametrize("width", WIDTHS)
def test_page_fits_into_every_width(shared: HandOnPage, width: int) -> None:
    shared.page.set_viewport_size({"width": width, "height": WIDTHS[width]})
    shared.await_drawing()
    assert shared.page.evaluate("innerWidth") == width
    assert shared.page.evaluate(
        "document.documentElement.scrollWidth <= document.documentElement.clientWidth"
    )
    assert shared.page.evaluate(BEYOND) == []
    box = shared.page.locator("#hold").bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= width
    assert 0 <= box["y"] <= WIDTHS[width] - box["height"], "the button is in sight"


@pytest.mark.parametrize("width", WIDTHS)
def test_every_control_is_large_enough_for_a_finger(shared: HandOnPage, width: int) -> None:
    shared.page.set_viewport_size({"width": width, "height": WIDTHS[width]})
    shared.await_drawing()
    assert shared.page.evaluate(SMALL, TARGET) == []


def test_phone_on_its_side_shows_button_engines_and_axes(shared: HandOnPage) -> None:
    shared.page.set_viewport_size({"width": 844, "height": 390})
    shared.await_drawing()
    for top in (0, 600):  # the page is scrolled to the processes, say
        shared.page.evaluate("top => scrollTo(0, top)", top)
        shared.await_drawing()
        for control in ("#hold", "#turn-on", "#turn-off"):
            box = shared.page.locator(control).bounding_box()
            assert 0 <= box["y"] <= 390 - box["height"], control
    heights = shared.page.evaluate(
        "[...document.querySelectorAll('#arm .ticks text')].map((it) => it.getBoundingClientRect().height)"
    )
    assert heights
    assert min(heights) >= LEGIBLE
    shared.page.evaluate("scrollTo(0, 0)")


def test_every_control_has_a_name(shared: HandOnPage) -> None:
    session = shared.context.new_cdp_session(shared.page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    names: dict[str, list[str]] = {role: [] for role in NAMED}
    for node in nodes:
        role = node.get("role", {}).get("value", "")
        if role in NAMED and not node["ignored"]:
            names[role].append(node.get("name", {}).get("value", ""))
    assert {role for role in NAMED if "" in names[role]} == set()
    assert [len(names[role]) for role in CONTROLS] == [8 + 2 * len(manifest.programs()), 4, 4]
    for role in CONTROLS:
        assert len(set(names[role])) == len(names[role]), "each name tells which control it is"


def test_page_runs_no_foreign_script(shared: HandOnPage) -> None:
    assert shared.errors == []  # of the whole page so far
    shared.page.evaluate(INLINE)
    shared.page.wait_for_timeout(200)
    assert shared.page.evaluate("window.ran") is None
    directives = set(shared.page.evaluate("violations"))
    assert directives >= {"script-src-elem", "img-src", "connect-src"}
    shared.errors.clear()


def test_address_without_its_token_shows_nothing(arm: Arm, browser: Any) -> None:
    assert arm.url.partition("#")[2]
    with closing(browser.new_context()) as context:
        hand = HandOnPage(context, arm.url)
        assert "#" not in hand.page.url, "the token stays in the address bar"
        hand.page.reload()
        hand.await_live()  # the tab keeps it
    with closing(browser.new_context()) as context:
        page = context.new_page()
        page.goto(arm.url.partition("#")[0] + "#wrong")
        page.wait_for_selector("html[data-connection=closed]")
        assert page.get_attribute("#hold", "data-state") == "offline"
        assert page.get_attribute("#engines", "data-state") == "unknown"
        page.goto("about:blank")
        page.goto(arm.url.partition("#")[0])  # the tab keeps the wrong token
        page.wait_for_selector("#banner-text:not(:empty)")
        assert "no token of the present start" in page.text_content("#banner-text")


def test_keyboard_alone_moves_the_arm_and_kills_a_process(arm: Arm, hand: HandOnPage) -> None:
    keyboard = hand.page.keyboard
    tab_to(hand, "#set-theta1")
    for _ in range(10):
        keyboard.press("ArrowRight")
    hand.page.wait_for_selector("#source-theta1[data-source=hand]", timeout=WAIT)
    tab_to(hand, "#follow-scenario")
    keyboard.press("Enter")
    hand.page.wait_for_selector("#source-theta1[data-source=scenario]", timeout=WAIT)

    killed = arm.site.members["kinematics"]
    tab_to(hand, "tr[data-process=kinematics] [data-action=kill]")
    keyboard.press("Enter")  # too short
    hand.page.wait_for_selector("#process-note:not([hidden])", timeout=WAIT)
    assert arm.site.members["kinematics"] == killed
    while arm.site.members.get("kinematics", killed) == killed:
        hand.await_live()
        keyboard.down("Enter")
        arm.site.await_members(
            lambda members: members.get("kinematics", killed) != killed or is_disconnected(hand)
        )
        keyboard.up("Enter")
    hand.page.wait_for_selector("tr[data-process=kinematics][data-back=yes]", timeout=WAIT)
    assert hand.errors == []


def is_disconnected(hand: HandOnPage) -> bool:
    """Whether the page says that nothing was killed because it was not connected; its user holds again."""
    return "not connected" in (hand.page.text_content("#process-note") or "")


def tab_to(hand: HandOnPage, selector: str) -> None:
    for _ in range(TABS):
        if hand.page.evaluate("it => document.activeElement.matches(it)", selector):
            return
        hand.page.keyboard.press("Tab")
    raise AssertionError(f"Tab does not lead to {selector}")


def test_page_shows_real_joints_and_does_not_set_them(
    browser: Any, tmp_path: Path, domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "robot.conf").write_text(
        "[program:gate]\ncommand = python3 -m services.examples.twist_gate\n"
    )
    monkeypatch.setenv("MANIFEST", str(tmp_path / "robot.conf"))
    with (
        closing(Arm(tmp_path / "run", domain_id, scenario="none")) as arm,
        closing(Peer(domain_id)) as joints,
        closing(browser.new_context()) as context,
    ):
        hand = HandOnPage(context, arm.url)
        for topic in topics.JOINTS:
            joints.publisher(topic).publish(Float64(data=0.5))
        hand.page.wait_for_selector("#set-l1:enabled", timeout=WAIT)
        deadline = time.monotonic() + LIMIT
        while hand.page.locator("#set-theta1").input_value() != "0.5":
            assert time.monotonic() < deadline, "the page does not show the joint"
            hand.page.wait_for_timeout(50)
        assert hand.page.locator("#set-theta1:disabled, #set-theta2:disabled").count() == 2
        hand.page.wait_for_selector("tr[data-process=gate]", timeout=WAIT)
        assert hand.page.locator("tr[data-process=config_theta1]").count() == 0
        assert hand.errors == []


def test_page_turns_grey_within_500_ms(arm: Arm, browser: Any, link: Link) -> None:
    with closing(browser.new_context()) as context:
        hand = HandOnPage(context, arm.url.replace("127.0.0.1", LINK), TIMING)
        hold_with_engines_on(arm, hand)
        for _ in range(SAMPLES):
            link.cut()
            hand.page.wait_for_selector("html[data-connection=lost]")
            link.mend()
            hand.await_live()
            hand.page.wait_for_timeout(200)
        link.cut()
        hand.page.wait_for_selector("html[data-connection=lost]")
        assert hand.page.is_visible("#banner")
        assert "Connection lost since" in (hand.page.text_content("#banner-text") or "")
        assert hand.page.get_attribute("#turn-on", "aria-disabled") == "true"
        assert hand.page.is_disabled("#set-l1")
        assert hand.state == "offline"

        samples = hand.page.evaluate("greyed")
        assert len(samples) > SAMPLES
        print(f"grey after {[tuple(map(round, it)) for it in samples]} ms, the second of a standstill")
        assert max(took - standstills for took, standstills in samples) <= 1000 * GREY
