"""A prompt with line editing, history and completion, below the lines that scroll."""

from __future__ import annotations

import asyncio
import os
import queue
import select
import signal
import sys
import termios
import threading
import time
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress

from prompt_toolkit import PromptSession
from prompt_toolkit.application import get_app
from prompt_toolkit.completion import WordCompleter
from prompt_toolkit.formatted_text import StyleAndTextTuples
from prompt_toolkit.input.vt100 import Vt100Input
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.patch_stdout import patch_stdout
from prompt_toolkit.shortcuts import CompleteStyle
from prompt_toolkit.styles import Style

from deploy.operator.output import say
from deploy.operator.state_line import BAD, GOOD, IDLE, SEPARATOR, WARN

CLOSE_LIMIT = 0.5  # s that the prompt has to vanish; it hangs where the terminal takes no output
STYLE = Style.from_dict({GOOD: "ansigreen", IDLE: "", WARN: "ansiyellow bold", BAD: "ansired bold"})
"""The colours that a terminal has; NO_COLOR=1 and a terminal without colours show none."""
STOP_TIME = 0.1  # s within which a stop signal takes effect on all threads


class Prompt:
    """A prompt on a thread: only this one waits for the terminal, so a stuck one holds up nothing else."""

    takes_input = True  # its end is an EOFError

    def __init__(self, words: Sequence[str]) -> None:
        # Only menus need the cursor's position; to ask the terminal for it doubles the cost of a line.
        os.environ["PROMPT_TOOLKIT_NO_CPR"] = "1"
        self._parts: Sequence[tuple[str, str]] = ()
        self._session: PromptSession[str] | None = None
        self._modes = termios.tcgetattr(0)
        self._typed: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._is_ready = threading.Event()
        self._hang_up = select.poll()
        self._hang_up.register(0, 0)
        self._loop = asyncio.new_event_loop()
        self._asking = self._loop.create_task(self._ask(words))
        self._thread = threading.Thread(target=self._run, name="prompt", daemon=True)
        self._thread.start()
        self._is_ready.wait()

    def show(self, lines: Iterable[str]) -> None:
        """Print lines above the prompt; drop them if the terminal has no room."""
        if text := "\n".join(lines):  # in one go, because the prompt is drawn again below
            say(text)

    def show_state(self, parts: Sequence[tuple[str, str]]) -> None:
        """Show a line above the prompt, until the next one."""
        if parts != self._parts:
            self._parts = parts
            with suppress(RuntimeError):  # its loop has ended
                self._loop.call_soon_threadsafe(self._draw)

    def read(self, seconds: float) -> list[str]:
        try:
            line = self._typed.get(timeout=seconds)
        except queue.Empty:
            if self._hang_up.poll(0):  # whatever the prompt does just now
                raise EOFError from None
            return []
        if line is None:
            raise EOFError
        return [line]

    def close(self) -> None:
        """Remove the prompt; a stuck terminal gets its modes back at least."""
        with suppress(RuntimeError):  # its loop has ended
            self._loop.call_soon_threadsafe(self._asking.cancel)
        self._thread.join(CLOSE_LIMIT)
        if self._thread.is_alive():
            with suppress(termios.error):  # the terminal is closed
                termios.tcsetattr(0, termios.TCSANOW, self._modes)

    def _run(self) -> None:
        try:
            with suppress(asyncio.CancelledError):
                self._loop.run_until_complete(self._asking)
        finally:
            self._is_ready.set()
            self._loop.close()

    async def _ask(self, words: Sequence[str]) -> None:
        keyboard = RawInput(sys.stdin)
        keys = KeyBindings()
        keys.add("c-z")(self._stop)
        session = self._session = PromptSession(
            self._message,
            style=STYLE,
            completer=WordCompleter(list(words)),
            complete_style=CompleteStyle.READLINE_LIKE,
            reserve_space_for_menu=0,
            key_bindings=keys,
            input=keyboard,
        )
        with patch_stdout(), keyboard.raw_mode():
            self._is_ready.set()
            while True:
                try:
                    self._typed.put(await session.prompt_async(set_exception_handler=False))
                except (EOFError, OSError):  # Ctrl-D, or the terminal is closed: only make gets its SIGHUP
                    self._typed.put(None)
                    return
                except KeyboardInterrupt:
                    os.killpg(0, signal.SIGINT)  # as a terminal does where no prompt reads the key
                    return

    def _message(self) -> StyleAndTextTuples:
        """Return the line and the prompt; what was typed stays in view without the line."""
        if get_app().is_done or not self._parts:
            return [("", "> ")]
        separated: StyleAndTextTuples = []
        for look, words in self._parts:
            separated += [("", SEPARATOR)] * bool(separated) + [(f"class:{look}", words)]
        return [*separated, ("", "\n> ")]

    def _draw(self) -> None:
        if self._session:
            self._session.app.invalidate()

    def _stop(self, event: KeyPressEvent) -> None:
        """Stop the process until it is continued, as a terminal does on Ctrl-Z."""
        event.app.renderer.erase()
        raw = termios.tcgetattr(0)
        termios.tcsetattr(0, termios.TCSANOW, self._modes)
        os.killpg(0, signal.SIGTSTP)
        time.sleep(STOP_TIME)
        termios.tcsetattr(0, termios.TCSANOW, raw)


class RawInput(Vt100Input):
    """A keyboard that stays in raw mode while lines are printed, so that no key is echoed or lost."""

    def cooked_mode(self) -> AbstractContextManager[None]:
        """Change nothing; prompt_toolkit prints in this mode."""
        return nullcontext()
