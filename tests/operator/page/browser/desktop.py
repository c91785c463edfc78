"""A Chromium on an X server of its own: real keys, real focus, real grabs of other programs.

Playwright pretends focus: `document.hasFocus()` is always true, and neither blur nor hidden events come. So
this drives the browser by plain CDP (https://chromedevtools.github.io/devtools-protocol).
"""

from __future__ import annotations

import importlib.util
import itertools
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import connect

from tests.system.sites import LIMIT

from .chromium import CHROMIUM, FLAGS, HandOnPage

SPACE, RETURN, TAB, PRINT = 0x20, 0xFF0D, 0xFF09, 0xFF61  # keysyms
SIZE = 1200, 900
LEFT = 1  # button of the mouse


def missing() -> str:
    """What this machine lacks for these tests; empty if nothing."""
    if not importlib.util.find_spec("Xlib"):
        return "python-xlib is not installed: make setup"
    return "" if shutil.which("Xvfb") else "there is no Xvfb: apt-get install xvfb"


class Desktop:
    """An X server with keyboard and mouse, without a window manager."""

    def __init__(self) -> None:
        from Xlib import X, display

        reading, writing = os.pipe()
        command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", f"{SIZE[0]}x{SIZE[1]}x24"]
        self._server = subprocess.Popen(command, pass_fds=[writing], stderr=subprocess.DEVNULL)
        os.close(writing)
        with open(reading) as pipe:
            self.name = f":{pipe.readline().strip()}"
            """The name of the display."""
        self._x = X
        self._display = display.Display(self.name)
        self._root = self._display.screen().root
        self._down: set[tuple[int, int]] = set()

    def press(self, keysym: int) -> None:
        """Press a key; the server repeats it until it is lifted, or another key is pressed."""
        self._input(self._x.KeyPress, self._display.keysym_to_keycode(keysym))

    def lift(self, keysym: int) -> None:
        self._input(self._x.KeyRelease, self._display.keysym_to_keycode(keysym))

    def press_mouse(self, x: float, y: float) -> None:
        self._display.xtest_fake_input(self._x.MotionNotify, x=round(x), y=round(y))
        self._input(self._x.ButtonPress, LEFT)

    def lift_mouse(self) -> None:
        self._input(self._x.ButtonRelease, LEFT)

    def lift_all(self) -> None:
        for kind, detail in list(self._down):
            self._input(kind + 1, detail)  # a release follows its press

    def _input(self, kind: int, detail: int) -> None:
        presses = kind in (self._x.KeyPress, self._x.ButtonPress)
        if presses:
            self._down.add((kind, detail))
        else:
            self._down.discard((kind - 1, detail))
        self._display.xtest_fake_input(kind, detail)
        self._display.sync()

    def focus(self) -> None:
        deadline = time.monotonic() + LIMIT
        while not (windows := list(self._windows())):
            assert time.monotonic() < deadline, "the browser shows no window"
            time.sleep(0.05)
        self._focus(windows[-1])

    def _windows(self) -> Iterator[Any]:
        for window in self._root.query_tree().children:
            if "Chromium" in (window.get_wm_class() or ()) and window.get_attributes().map_state:
                yield window

    def _focus(self, window: Any) -> None:
        self._display.set_input_focus(window, self._x.RevertToPointerRoot, self._x.CurrentTime)
        self._display.sync()

    @contextmanager
    def other_window(self) -> Iterator[None]:
        """Give the focus to another window in the corner of the screen."""
        window = self._root.create_window(SIZE[0] - 20, SIZE[1] - 20, 10, 10, 0, self._x.CopyFromParent)
        window.map()
        self._focus(window)
        yield
        window.destroy()
        self.focus()

    @contextmanager
    def hotkey(self) -> Iterator[None]:
        """Hold a hotkey of the desktop, which takes all keys until it is lifted."""
        code = self._display.keysym_to_keycode(PRINT)
        self._root.grab_key(code, self._x.AnyModifier, False, self._x.GrabModeAsync, self._x.GrabModeAsync)
        self.press(PRINT)
        yield
        self.lift(PRINT)
        self._root.ungrab_key(code, self._x.AnyModifier)
        self._display.sync()

    @contextmanager
    def grab(self) -> Iterator[None]:
        """Take all keys, as a screen lock, a password prompt or a launcher does."""
        self._root.grab_keyboard(False, self._x.GrabModeAsync, self._x.GrabModeAsync, self._x.CurrentTime)
        self._display.sync()
        yield
        self._display.ungrab_keyboard(self._x.CurrentTime)
        self._display.sync()

    def close(self) -> None:
        self._display.close()
        self._server.terminate()
        self._server.wait()


class PlainPage:
    """The page in a Chromium; as much of Playwright's interface as :class:`HandOnPage` needs."""

    def __init__(self, url: str, display: str) -> None:
        self._url = url
        self._numbers = itertools.count(1)
        with ExitStack() as stack:
            profile = Path(tempfile.mkdtemp())
            stack.callback(shutil.rmtree, profile, ignore_errors=True)
            size = f"--window-size={SIZE[0]},{SIZE[1]}"
            flags = [*FLAGS, "--remote-debugging-port=0", f"--user-data-dir={profile}", size]
            flags.remove("--headless=new")
            browser = subprocess.Popen(
                [CHROMIUM, *flags, "--window-position=0,0", "about:blank"],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=os.environ | {"DISPLAY": display, "TMPDIR": str(profile)},
            )
            stack.callback(browser.wait, LIMIT)
            stack.callback(browser.terminate)
            port, path = self._address(profile / "DevToolsActivePort")
            self._socket = stack.enter_context(connect(f"ws://127.0.0.1:{port}{path}", max_size=None))
            (target,) = (it for it in self._call("Target.getTargets")["targetInfos"] if it["type"] == "page")
            attached = self._call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
            self._session = attached["sessionId"]
            self.close = stack.pop_all().close
            """Closes the browser."""

    @staticmethod
    def _address(file: Path) -> tuple[str, str]:
        deadline = time.monotonic() + LIMIT
        while not (file.exists() and len(lines := file.read_text().split()) == 2):
            assert time.monotonic() < deadline, "the browser does not start"
            time.sleep(0.05)
        return lines[0], lines[1]

    def _call(self, method: str, session: str | None = None, **parameters: object) -> Any:
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters}
        self._socket.send(json.dumps(message | ({"sessionId": session} if session else {})))
        while True:
            answer = json.loads(self._socket.recv(timeout=LIMIT))
            if answer.get("id") == number:
                assert "result" in answer, answer
                return answer["result"]

    def add_init_script(self, script: str) -> None:
        self._call("Page.addScriptToEvaluateOnNewDocument", self._session, source=script)

    def reload(self) -> None:
        self._call("Page.enable", self._session)
        self._call("Page.navigate", self._session, url="about:blank")
        self._call("Page.navigate", self._session, url=self._url)

    def show_other_tab(self) -> Callable[[], None]:
        """Show a new tab; returns what shows this one again."""
        other = self._call("Target.createTarget", url="about:blank")["targetId"]

        def show_again() -> None:
            self._call("Target.closeTarget", targetId=other)
            self.bring_to_front()

        return show_again

    def bring_to_front(self) -> None:
        self._call("Page.bringToFront", self._session)

    def evaluate(self, expression: str) -> Any:
        options = {"expression": expression, "returnByValue": True, "awaitPromise": True}
        answer = self._call("Runtime.evaluate", self._session, **options)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait_for_selector(
        self, selector: str, state: str = "attached", timeout: float = 1000 * LIMIT
    ) -> None:
        """Wait until the page has such an element; ``timeout`` [ms]."""
        deadline = time.monotonic() + timeout / 1000
        while not self.evaluate(f"!!document.querySelector({json.dumps(selector)})"):
            assert time.monotonic() < deadline, f"no {selector}"
            time.sleep(0.02)

    def get_attribute(self, selector: str, name: str) -> Any:
        return self.evaluate(f"document.querySelector({json.dumps(selector)}).getAttribute('{name}')")

    def text_content(self, selector: str) -> Any:
        return self.evaluate(f"document.querySelector({json.dumps(selector)}).textContent")


class HandAtDesktop(HandOnPage):
    """A hand at keyboard and mouse of a desktop that shows the page."""

    page: PlainPage

    def __init__(self, desktop: Desktop, page: PlainPage) -> None:
        """:param page: a browser on the desktop."""
        self.desktop = desktop
        self.page = page
        self.start_over()

    def start_over(self) -> None:
        self.desktop.lift_all()
        self.page.reload()
        self.page.wait_for_selector("html[data-connection=live]")
        self.desktop.focus()
        self.page.bring_to_front()  # the focus may be in the address bar
        self.until("document.hasFocus()")
        self.page.evaluate("document.querySelector('#hold').focus()")

    def until(self, expression: str) -> None:
        deadline = time.monotonic() + LIMIT
        while not self.page.evaluate(expression):
            assert time.monotonic() < deadline, f"not {expression}"
            time.sleep(0.02)

    def point(self) -> tuple[float, float]:
        x, y = self.page.evaluate(
            "(({ x, y }) => [screenX + x + 40, screenY + outerHeight - innerHeight + y + 30])"
            "(document.querySelector('#hold').getBoundingClientRect())"
        )
        return x, y

    def down(self) -> None:
        self.desktop.press_mouse(*self.point())

    def up(self) -> None:
        self.desktop.lift_mouse()

    def tab(self) -> None:
        self.desktop.press(TAB)
        self.desktop.lift(TAB)


@contextmanager
def hand_at_desktop(url: str, *scripts: str) -> Iterator[HandAtDesktop]:
    """Show the page on a desktop; skip the test where that is not possible."""
    if reason := missing():
        pytest.skip(reason)
    with closing(Desktop()) as desktop, closing(PlainPage(url, desktop.name)) as page:
        for script in scripts:
            page.add_init_script(script)
        yield HandAtDesktop(desktop, page)
