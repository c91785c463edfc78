"""The display of the terminal: a prompt if it can show one, plain lines elsewhere."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from deploy.operator.terminal.plain import PlainLines

if TYPE_CHECKING:
    from deploy.operator.terminal.prompt import Prompt


def open_display(words: Sequence[str]) -> PlainLines | Prompt:
    """Return the display of this process; a prompt completes the words."""
    if not _takes_a_prompt():
        return PlainLines()
    from deploy.operator.terminal.prompt import Prompt  # loads prompt_toolkit: 0.1 s

    return Prompt(words)


def _takes_a_prompt() -> bool:
    """Whether this process is in the foreground of a terminal with a movable cursor."""
    if not (os.isatty(0) and os.isatty(1)) or os.environ.get("TERM", "") in ("", "dumb", "unknown"):
        return False
    with suppress(OSError):  # it is not our controlling terminal
        return os.tcgetpgrp(0) == os.getpgrp()
    return False
