"""Conditions that the user writes as Python expressions of ``m``, the message."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click


def condition(text: str | None) -> Callable[[Any], bool]:
    """Return the function that evaluates an expression; without one, it is always true.

    The expression may use all of Python: it comes from the user's own command line.

    :raises ClickException: if it is malformed, or later, if it fails for a message.
    """
    if text is None:
        return lambda _: True
    try:
        code = compile(text, "<filter>", "eval")
    except SyntaxError as error:
        raise click.ClickException(f"The filter '{text}' is no Python expression: {error.msg}") from None

    def holds(message: Any) -> bool:
        try:
            return bool(eval(code, {"m": message}))
        except Exception as error:
            raise click.ClickException(f"The filter '{text}' failed: {error}") from None

    return holds
