"""Chromium, and the operator's page in it as a hand finds it."""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.system.sites import LIMIT

CHROMIUM = "/usr/bin/chromium"
FLAGS = [
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-features=SpareRendererForSitePerProcess",  # a process for each page to come: none comes
]

RECORDING = """
window.sent = [];
window.WebSocket = class extends WebSocket {
    send(text) {
        const { type, nonce, name } = JSON.parse(text);
        sent.push({ type, nonce, name, at: Date.now() });
        super.send(text);
    }
};
"""
"""Notes what the page sends."""

STUBBORN = """
let nonce;
let isStubborn = false;
window.beStubborn = () => { isStubborn = true; };
window.WebSocket = class extends WebSocket {
    constructor(...options) {
        super(...options);
        this.addEventListener("message", (event) => { nonce = JSON.parse(event.data).nonce ?? nonce; });
        setInterval(() => {
            if (isStubborn && this.readyState === 1) super.send(JSON.stringify({ type: "beat", nonce }));
        }, 50);
    }
    send(text) {
        if (!isStubborn) super.send(text);
    }
};
"""
"""Makes the page go on to beat with the newest nonce whatever happens, and never release."""

PAD = """
window.pad = {
    index: 0, connected: true, mapping: "standard", axes: [0, 0, 0, 0],
    buttons: Array.from({ length: 17 }, () => ({ value: 0, pressed: false })),
    get timestamp() { return this.frozen ?? performance.now(); },
};
navigator.getGamepads = () => [pad];
window.announce = (type) => dispatchEvent(Object.assign(new Event(type), { gamepad: pad }));
"""
"""A gamepad, until it has `frozen`."""

TABS = 100  # more than the page has stops
DECIDED = "#hold[data-state=held], #hold[data-state=other_page], #hold-why:not(:empty)"
"""What the page has when a press has led to a hold or to a refusal."""

STALLS = ("too busy", "word from the server", "too slow", "no beat came", " ms late")
"""Reasons for a release that a machine gives which stands still for 250 ms: no behaviour of the page."""


def missing() -> str:
    """What this machine lacks for these tests; empty if nothing."""
    try:
        import playwright  # noqa: F401
    except ImportError:
        return "playwright is not installed: make setup"
    return "" if shutil.which(CHROMIUM) else f"there is no {CHROMIUM}: apt-get install chromium"


@contextmanager
def playwright() -> Iterator[Any]:
    if reason := missing():
        pytest.skip(reason)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as started:
        yield started


@contextmanager
def launched(started: Any) -> Iterator[Any]:
    """A browser with a temporary folder of its own, in which it leaves files if it is killed."""
    with tempfile.TemporaryDirectory(prefix="chromium-", ignore_cleanup_errors=True) as folder:
        browser = started.chromium.launch(
            executable_path=CHROMIUM,
            args=FLAGS,
            env=os.environ | {"TMPDIR": folder},
            headless=False,  # --headless=new is among the flags
            handle_sigint=False,
            handle_sigterm=False,
            handle_sighup=False,
        )
        with closing(browser):
            yield browser


def processes_of(browser: Any) -> list[int]:
    infos = browser.new_browser_cdp_session().send("SystemInfo.getProcessInfo")["processInfo"]
    (root,) = (info["id"] for info in infos if info["type"] == "browser")
    return [root, *_descendants(root)]


def _descendants(pid: int) -> Iterator[int]:
    for file in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, file.read_text().split()):
            yield child
            yield from _descendants(child)


def signal_all(pids: list[int], number: signal.Signals) -> None:
    """Send a signal to processes that may have ended."""
    for pid in pids:
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            continue


class Fingers:
    """Fingers on a touch screen."""

    def __init__(self, page: Any) -> None:
        self._session = page.context.new_cdp_session(page)
        self._down: dict[int, tuple[float, float]] = {}

    def put(self, finger: int, point: tuple[float, float]) -> None:
        kind = "touchMove" if finger in self._down else "touchStart"
        self._down[finger] = point
        self._dispatch(kind, self._down)

    def lift(self, finger: int = 0) -> None:
        point = self._down.pop(finger)
        self._dispatch("touchEnd", {finger: point} if self._down else {})

    def _dispatch(self, kind: str, fingers: dict[int, tuple[float, float]]) -> None:
        points = [{"id": finger, "x": x, "y": y} for finger, (x, y) in fingers.items()]
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


class HandOnPage:
    def __init__(self, context: Any, url: str, *scripts: str) -> None:
        """:param scripts: JavaScript that runs before the page's own."""
        self.context = context
        self.page = context.new_page()
        self.errors: list[str] = []
        """What the page writes to the browser's console, and its errors."""
        self.page.on("console", lambda message: self.errors.append(message.text))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        for script in (RECORDING, *scripts):
            self.page.add_init_script(script)
        self.page.goto(url)
        self.await_live()

    def start_over(self) -> None:
        for key in (" ", "Enter"):
            self.page.keyboard.up(key)
        self.up()
        self.page.reload()
        self.await_live()

    def await_live(self) -> None:
        self.page.wait_for_selector("html[data-connection=live]", timeout=1000 * LIMIT)

    @property
    def state(self) -> str:
        return str(self.page.get_attribute("#hold", "data-state"))

    @property
    def why(self) -> str:
        return self.page.text_content("#hold-why") or ""

    def await_state(self, *states: str) -> None:
        selector = ", ".join(f"#hold[data-state={state}]" for state in states)
        self.page.wait_for_selector(selector, timeout=1000 * LIMIT)

    def sent(self, kind: str) -> int:
        """How many messages of a kind the page has sent since it was loaded."""
        return int(self.page.evaluate("kind => sent.filter(it => it.type === kind).length", kind))

    def point(self) -> tuple[float, float]:
        box = self.page.locator("#hold").bounding_box()
        return box["x"] + 40, box["y"] + 30

    def down(self) -> None:
        self.page.mouse.move(*self.point())
        self.page.mouse.down()

    def up(self) -> None:
        self.page.mouse.up()

    def hold(self, down: Callable[[], None] | None = None, up: Callable[[], None] | None = None) -> None:
        """Hold until the switch is held; press again if the machine stood still for too long."""
        deadline = time.monotonic() + LIMIT
        while True:
            (down or self.down)()
            self.await_drawing()
            self.page.wait_for_selector(DECIDED, state="attached", timeout=1000 * LIMIT)
            if self.state == "held":
                return
            assert self.stalled, f"not held: {self.state}, {self.why!r}"
            assert time.monotonic() < deadline, "the machine stands still all the time"
            (up or self.up)()

    def hold_until(self, selector: str) -> None:
        """Hold until the page shows something; begin again if the machine stood still for too long."""
        while True:
            self.hold()
            self.page.wait_for_selector(f"{selector}, #hold:not([data-state=held])", timeout=1000 * LIMIT)
            if self.page.is_visible(selector):
                return
            assert self.stalled, f"not held any more: {self.state}, {self.why!r}"
            self.up()

    def tab_to(self, selector: str) -> None:
        for _ in range(TABS):
            if self.page.evaluate(f"document.activeElement.matches('{selector}')"):
                return
            self.tab()
            self.await_drawing()
        raise AssertionError(f"Tab does not lead to {selector}")

    def tab(self) -> None:
        self.page.keyboard.press("Tab")

    def await_drawing(self) -> None:
        self.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    @property
    def stalled(self) -> bool:
        """Whether the hold ended because the machine stood still."""
        return any(reason in self.why for reason in STALLS)
