"""The report of chaos and simulation in a browser."""

from __future__ import annotations

from contextlib import closing
from typing import Any

import pytest

from tests.promises.histories import good, killed
from tests.promises.html_report import html
from tests.promises.promises import checked

LEGIBLE = 12  # px
TOO_WIDE = """
() => [...document.querySelectorAll(".card:has(table)")]
    .filter((it) => it.scrollWidth > it.clientWidth).map((it) => it.textContent)
"""
SMALL = """
(least) => [...document.querySelectorAll("h1, h2, p, td, .evidence, text")]
    .filter((it) => parseFloat(getComputedStyle(it).fontSize) < least).map((it) => it.textContent)
"""
SCROLL = """
() => [...document.querySelectorAll(".chart")].map((card) => {
    card.scrollLeft = card.scrollWidth;
    const names = card.querySelector(".names").getBoundingClientRect();
    return [card.scrollLeft, names.left - card.getBoundingClientRect().left, names.height];
})
"""


@pytest.mark.parametrize("width", [320, 390, 844, 1280])
def test_report_is_read_without_moving_its_tables(browser: Any, width: int) -> None:
    history = killed(good(), "kinematics", 20.0, 9.0)
    findings = [*checked(history)]
    with closing(browser.new_context(viewport={"width": width, "height": 844})) as context:
        page = context.new_page()
        page.set_content(html("chaos", ["Seed 7."], findings, history))
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate(TOO_WIDE) == []
        assert page.evaluate(SMALL, LEGIBLE) == []
        for chart in page.locator(".chart").all():
            page.keyboard.press("Tab")
            assert chart.evaluate("it => it === document.activeElement")
        for scrolled, left, height in page.evaluate(SCROLL):
            assert (width > 1000) or scrolled > 0
            assert 0 <= left <= 20, "the names of the rows stay"
            assert height > 200
