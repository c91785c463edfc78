"""Text of others in HTML and SVG."""

from __future__ import annotations

from html import escape

from interfaces.plain_text import plain


def plain_html(text: str) -> str:
    """Return a text in the same way as :func:`plain`, for HTML and SVG."""
    return escape(plain(text))
