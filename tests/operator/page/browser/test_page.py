"""The page in a browser: reachable by keyboard and screen reader, strict, in every width, never stale."""

from __future__ import annotations

import os
import re
import signal
import time
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import pytest
from std_msgs.msg import Float64

from deploy.operator.page.server import MAX_PAGES
from deploy.supervision import manifest
from interfaces import topics
from tests.operator.page.clients import Hand
from tests.system.records import engine_states
from tests.system.sites import LIMIT, Peer

from .arm import LINK, Arm, hold_with_engines_on
from .chromium import HandOnPage
from .link import Link

pytestmark = pytest.mark.timed

WIDTHS = {320: 568, 360: 640, 390: 844, 640: 400, 844: 390, 1280: 800, 3840: 2160}
TARGET = 44  # px
LEGIBLE = 11  # px, the height of the letters' box
CONTROLS = ("button", "slider", "spinbutton")
NAMED = (*CONTROLS, "link", "textbox", "image", "table", "region")
WAIT = 1000 * LIMIT  # ms
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

CUT_OFF = """
[...document.querySelectorAll("#hold, #turn-on, #turn-off, #health, #connection")].filter((it) =>
    it.scrollWidth > it.clientWidth + 1 || it.scrollHeight > it.clientHeight + 1
).map((it) => `${it.id} ${it.textContent}`)
"""
"""The controls whose text reaches beyond them."""

COVERED = """
["hold", "turn-on", "turn-off"].filter((id) => {
    const it = document.getElementById(id);
    const { x, y, width, height } = it.getBoundingClientRect();
    return !it.contains(document.elementFromPoint(x + width / 2, y + height / 2));
})
"""
"""The controls that something lies upon."""

SMALL = """
(least) => [...document.querySelectorAll("button, input, a")].filter((it) =>
    it.checkVisibility() && !it.matches(".skip")
).map((it) => [it.id || it.ariaLabel || it.textContent, it.getBoundingClientRect()]).filter(
    ([, { width, height }]) => Math.min(width, height) < least - 0.5
).map(([name, { width, height }]) => `${name} ${width} ${height}`)
"""
"""The controls that are smaller than a size [px]."""

NO_STORAGE = """
Object.defineProperty(window, "sessionStorage", { get() { throw new DOMException("", "SecurityError"); } });
"""

HEALTH = """
[
    document.getElementById("health-text").textContent,
    document.querySelectorAll("#processes tr[data-ok=yes][data-state=running]").length,
    document.querySelectorAll("#processes tbody tr").length,
]
"""

BREAK = """
() => new MutationObserver(() => document.body.setAttribute("data-breaks", "yes")).observe(
    document.querySelector("[data-node=controller]"), { attributeFilter: ["data-away"] },
)
"""
"""Notes whether the drawing of the chain breaks, however shortly."""


@pytest.fixture(scope="module")
def shared(arm: Arm, browser: Any) -> Any:
    """A page that shows the arm; the tests leave it as it was."""
    with closing(browser.new_context()) as context:
        hand = HandOnPage(context, arm.url)
        hand.page.wait_for_selector("tr[data-process=kinematics][data-ok=yes]")
        yield hand


@pytest.mark.parametrize("width", WIDTHS)
def test_page_fits_into_every_width(shared: HandOnPage, width: int) -> None:
    page = shared.page
    page.set_viewport_size({"width": width, "height": WIDTHS[width]})
    shared.await_drawing()
    assert page.evaluate("innerWidth") == width
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    assert page.evaluate(BEYOND) == []
    assert page.evaluate(CUT_OFF) == []
    assert page.evaluate(SMALL, TARGET) == []
    places = []
    for top in (0, 300, 1e6):
        page.evaluate("top => scrollTo(0, top)", top)
        shared.await_drawing()
        boxes = [page.locator(it).bounding_box() for it in ("#hold", "#turn-on", "#turn-off")]
        for box in boxes:
            assert 0 <= box["y"] <= WIDTHS[width] - box["height"]
            assert 0 <= box["x"] <= width - box["width"]
        places.append(boxes)
        assert page.evaluate(COVERED) == []
    page.evaluate("scrollTo(0, 0)")
    assert width >= 700 or places[0] == places[1] == places[2], "hand and engines stay at their place"


def test_phone_on_its_side_shows_axes(shared: HandOnPage) -> None:
    shared.page.set_viewport_size({"width": 844, "height": 390})
    shared.await_drawing()
    heights = shared.page.evaluate(
        "[...document.querySelectorAll('#arm .ticks text')].map((it) => it.getBoundingClientRect().height)"
    )
    assert heights
    assert min(heights) >= LEGIBLE


def test_every_control_has_a_name(shared: HandOnPage) -> None:
    session = shared.context.new_cdp_session(shared.page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    names: dict[str, list[str]] = {role: [] for role in NAMED}
    for node in nodes:
        role = node.get("role", {}).get("value", "")
        if role in NAMED and not node["ignored"]:
            names[role].append(node.get("name", {}).get("value", ""))
    assert {role for role in NAMED if "" in names[role]} == set()
    assert [len(names[role]) for role in CONTROLS] == [13 + 2 * len(manifest.programs()), 4, 4]
    for role in CONTROLS:
        assert len(set(names[role])) == len(names[role]), "each name says which control it is"
    assert shared.errors == []  # of the whole page so far


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
    hand.tab_to("#set-theta1")
    for _ in range(10):
        keyboard.press("ArrowRight")
    hand.page.wait_for_selector("#source-theta1[data-source=hand]", timeout=WAIT)
    hand.tab_to("#follow-scenario")
    keyboard.press("Enter")  # too short: the arm would jump
    hand.page.wait_for_selector("#set-note:text('jumps')", timeout=WAIT)
    assert hand.sent("follow_scenario") == 0
    keyboard.down("Enter")
    hand.page.wait_for_selector("#source-theta1[data-source=scenario]", timeout=WAIT)
    keyboard.up("Enter")

    killed = arm.site.members["kinematics"]
    hand.tab_to("tr[data-process=kinematics] [data-action=kill]")
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


def test_slider_moves_the_arm_no_faster_than_a_hand(arm: Arm, hand: HandOnPage) -> None:
    hand.page.wait_for_selector("#set-theta1:enabled", timeout=WAIT)
    begin = time.monotonic()
    hand.page.fill("#number-theta1", "1")
    hand.page.press("#number-theta1", "Enter")
    hand.page.wait_for_selector("#arm[data-power=moved] .power:text('engines off')", timeout=WAIT)
    hand.page.wait_for_selector("#arm .angle-label:text('57.3°')", timeout=WAIT)
    assert time.monotonic() - begin > 0.8  # 1 rad at 1 rad/s
    assert hand.sent("set") >= 9
    hand.page.wait_for_selector("#arm[data-power=off]", timeout=WAIT)
    for _ in range(2):
        hand.page.evaluate("document.getElementById('follow-scenario').click()")
    hand.page.wait_for_selector("#source-theta1[data-source=scenario]", timeout=WAIT)


def test_node_that_is_killed_in_the_drawing_heals(arm: Arm, hand: HandOnPage) -> None:
    hold_with_engines_on(arm, hand)
    for node in ("hand", "watchdog", "controller"):
        hand.page.wait_for_selector(f"[data-node={node}] .strong[d*=M]", state="attached", timeout=WAIT)
    killed = arm.site.members["engine_controller"]
    hand.page.focus("[data-node=controller] button")
    hand.page.wait_for_selector("[data-node=drive][data-acts]", timeout=WAIT)
    assert "the drive stands still after 0.4 s" in (hand.page.text_content("#chain-safe") or "")
    hand.page.evaluate(BREAK)
    hand.page.keyboard.down("Enter")
    hand.page.wait_for_selector("body[data-breaks]", timeout=WAIT)
    hand.page.keyboard.up("Enter")
    hand.page.wait_for_selector("[data-node=controller] .stamp:text-matches('back in [01]')", timeout=WAIT)
    hand.page.wait_for_selector("[data-node=controller] .strong:not([d*=M])", state="attached", timeout=WAIT)
    hand.page.wait_for_selector("[data-node=controller] .weak[d*=M]", state="attached", timeout=WAIT)
    assert arm.site.members["engine_controller"] != killed
    assert hand.errors == []


def test_phone_tells_who_is_the_hand(hand: HandOnPage) -> None:
    hand.page.set_viewport_size({"width": 360, "height": 640})
    hand.hold_until("#mini-operator:visible:text('You hold')")
    hand.up()
    hand.page.wait_for_selector("#mini-operator:visible:text('Operator')", timeout=WAIT)


def test_last_stop_is_replayed_until_a_hand_holds(arm: Arm, hand: HandOnPage) -> None:
    hold_with_engines_on(arm, hand)
    hand.page.wait_for_selector("#engines[data-state=on]", timeout=WAIT)
    hand.up()
    hand.page.click("#turn-off")
    replay_until(hand, "#arm[data-power=on]")
    assert hand.page.is_hidden("#record")
    assert hand.page.get_attribute("#engines", "data-state") == "off", (
        "the rest of the page shows what is now"
    )
    hand.hold_until("html:not([data-replay]) #arm[data-power=off]")
    assert hand.errors == []


def test_replay_links_its_record(arm: Arm, hand: HandOnPage, tmp_path: Path) -> None:
    recorder = arm.site.begin("record", "10")
    ring = Path(recorder.await_line("Recording to (/.*/ring)")[1])
    hold_with_engines_on(arm, hand)
    arm.record.until(lambda: any(engine_states(path).count(topics.ON) > 5 for path in ring.iterdir()))
    hand.up()
    hand.page.click("#turn-off")
    replay_until(hand, "#record:text('Save its record, stop-')")
    with hand.page.expect_download(timeout=WAIT) as download:
        hand.page.click("#record", timeout=WAIT)
    download.value.save_as(tmp_path / "stop.mcap")
    recorder.signal(signal.SIGINT)
    assert recorder.wait() == 0
    assert set(engine_states(tmp_path / "stop.mcap")) == {topics.ON, topics.OFF}
    assert hand.errors == []


def replay_until(hand: HandOnPage, selector: str) -> None:
    """Replay the last stop until something is shown; a machine that stands still ends a replay."""
    deadline = time.monotonic() + LIMIT
    while not hand.page.is_visible(f"html[data-replay=yes] {selector}"):
        assert time.monotonic() < deadline, f"no replay shows {selector}"
        if hand.page.get_attribute("html", "data-replay") is None:
            hand.page.click("#rewind", timeout=WAIT)
        hand.page.wait_for_timeout(50)


def is_disconnected(hand: HandOnPage) -> bool:
    """Whether the page says that nothing was killed because it was not connected; its user holds again."""
    return "not connected" in (hand.page.text_content("#process-note") or "")


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


def test_page_lies_under_a_path_of_a_reverse_proxy(arm: Arm, browser: Any) -> None:
    with (
        closing(Link(LINK, ("127.0.0.1", arm.port), b"/robots/arm/")),
        closing(browser.new_context()) as context,
    ):
        address, _, token = arm.url.replace("127.0.0.1", LINK).partition("#")
        hand = HandOnPage(context, f"{address}robots/arm/#{token}")
        hand.page.wait_for_selector("tr[data-process=kinematics][data-ok=yes]", timeout=WAIT)
        assert hand.errors == []


@pytest.mark.parametrize("hand", [NO_STORAGE], indirect=True)
def test_page_works_where_the_browser_stores_nothing(hand: HandOnPage) -> None:
    assert hand.errors == []
    hand.page.reload()
    hand.await_live()  # the address keeps the token


def test_page_that_is_one_too_many_says_so_and_opens_when_another_closes(arm: Arm, browser: Any) -> None:
    with ExitStack() as opened, closing(browser.new_context()) as context:
        pages = [opened.enter_context(closing(Hand(arm.url))) for _ in range(MAX_PAGES)]
        page = context.new_page()
        page.goto(arm.url)
        page.wait_for_selector("#banner-text:text('8 pages are open already')", timeout=WAIT)
        assert page.text_content("#connection-text") == "Not connected"
        pages[0].close()
        page.wait_for_selector("html[data-connection=live]", timeout=WAIT)
        assert page.is_hidden("#banner")


def test_stopped_motion_leaves_no_speed(arm: Arm, hand: HandOnPage) -> None:
    hand.page.wait_for_selector("#speed:text('0.00')", timeout=WAIT)
    hand.page.wait_for_selector("#x:not(:text('–'))", timeout=WAIT)
    process = arm.site.members["twist"]
    os.kill(process, signal.SIGSTOP)
    try:
        for name in ("speed", "x", "y"):
            hand.page.wait_for_selector(f"#{name}:text('–')", timeout=WAIT)
        hand.page.wait_for_selector("#arm [data-heard=no]", timeout=WAIT)
        hand.page.wait_for_selector(".slider[data-heard=no] #set-theta1", timeout=WAIT)
        assert hand.page.input_value("#number-theta1") == ""
    finally:
        os.kill(process, signal.SIGCONT)
    hand.page.wait_for_selector("#speed:text('0.00')", timeout=WAIT)
    hand.page.wait_for_selector("#arm [data-heard=yes]", timeout=WAIT)


def test_header_counts_who_is_well_and_leads_to_who_is_not(arm: Arm, hand: HandOnPage) -> None:
    os.kill(arm.site.members["robot_state"], signal.SIGSTOP)  # until the sentinel replaces it
    hand.page.wait_for_selector("tr[data-process=robot_state][data-ok=no]", timeout=WAIT)
    text, well, rows = hand.page.evaluate(HEALTH)
    assert well < rows
    assert text == f"{well} of {rows} ok"
    hand.page.click("#health")
    box = hand.page.locator("#processes tr[data-ok=no]").first.bounding_box()
    assert 0 < box["y"] < hand.page.viewport_size["height"]
    hand.page.wait_for_selector("tr[data-process=robot_state][data-ok=yes]", timeout=WAIT)


def test_page_that_does_not_start_says_so(arm: Arm, browser: Any) -> None:
    with closing(browser.new_context()) as context:
        context.route("**/static/main.js", lambda route: route.fulfill(body="import './nothing.js';"))
        context.route("**/static/reload.js", lambda route: route.fulfill(body=""))
        page = context.new_page()
        page.goto(arm.url)
        assert page.is_visible("#banner")
        assert "No word from the arm yet." in (page.text_content("#banner-text") or "")
        assert "Connecting" not in (page.text_content("header") or "")


def test_error_of_the_page_is_shown_and_in_the_log_once(arm: Arm, hand: HandOnPage) -> None:
    assert hand.page.is_hidden("#fault")
    for _ in range(3):
        hand.page.evaluate("setTimeout(() => nothing(1))")
        hand.page.evaluate("Promise.reject(new Error('broken \\u001b[31m promise')) && null")
    hand.page.wait_for_selector(
        "#fault:has-text('broken'):has-text('may show what is not true')", timeout=WAIT
    )
    for width, height in WIDTHS.items():
        hand.page.set_viewport_size({"width": width, "height": height})
        hand.await_drawing()
        assert hand.page.evaluate(COVERED) == []
    log = arm.site.run / "logs" / "operator_page.log"
    expected = ("a page: ReferenceError: nothing is not defined", "a page: Error: broken [31m promise")
    arm.record.until(lambda: all(words in log.read_text() for words in expected))
    hand.page.evaluate("setTimeout(() => last())")
    arm.record.until(lambda: "last is not defined" in log.read_text())
    assert [log.read_text().count(words) for words in expected] == [1, 1]
    hand.errors.clear()


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
        shown = hand.page.text_content("#banner-age") or ""
        assert re.match(r"The engines stop by \d\d:\d\d:\d\d at the latest", shown)
        for name in ("speed", "x", "y"):
            assert hand.page.text_content(f"#{name}") == "–"
        assert hand.page.get_attribute("#engines", "data-state") == "unknown"
        assert hand.page.get_attribute("tr[data-process=kinematics]", "data-state") == "unknown"
        assert hand.page.get_attribute("#turn-on", "aria-disabled") == "true"
        assert hand.page.is_disabled("#set-l1")
        assert hand.state == "offline"

        samples = hand.page.evaluate("greyed")
        assert len(samples) > SAMPLES
        print(f"grey after {[tuple(map(round, it)) for it in samples]} ms, the second of a standstill")
        assert max(took - standstills for took, standstills in samples) <= 1000 * GREY
