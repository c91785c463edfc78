"""axe finds nothing to complain about on the page and the report, and the report is read in every width."""

from __future__ import annotations

from contextlib import closing
from importlib.resources import files
from typing import Any

import pytest

from tests.promises.histories import good, killed
from tests.promises.html_report import html
from tests.promises.promises import checked

from .arm import Arm, hold_with_engines_on
from .chromium import HandOnPage

pytestmark = pytest.mark.timed

SIZES = {
    "desktop": (1280, 800),
    "phone": (390, 844),
    "phone on its side": (844, 390),
    "small phone": (360, 640),
    "zoomed": (640, 400),  # 1280 x 800 at 200 %
}
FOUND = """
async () => (await axe.run(document, { resultTypes: ["violations"] })).violations.flatMap(
    ({ id, nodes }) => nodes.map((it) => `${id}: ${it.target} ${it.any.map((each) => each.message)}`)
)
"""

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


def found(page: Any) -> list[str]:
    """Return what axe finds."""
    page.evaluate((files("axe_playwright_python") / "axe.min.js").read_text())
    return list(page.evaluate(FOUND))


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
def test_axe_finds_nothing_on_the_page(arm: Arm, browser: Any, size: str, scheme: str) -> None:
    width, height = SIZES[size]
    options = {"viewport": {"width": width, "height": height}, "color_scheme": scheme}
    with closing(browser.new_context(**options)) as context:
        hand = HandOnPage(context, arm.url)
        hand.page.wait_for_selector("tr[data-process=kinematics][data-ok=yes]")
        assert found(hand.page) == []
        hold_with_engines_on(arm, hand)
        hand.page.wait_for_selector("#engines[data-state=on]")
        assert found(hand.page) == []
        hand.up()
        context.set_offline(True)
        hand.page.evaluate("dispatchEvent(new Event('pagehide'))")
        hand.page.wait_for_selector("html:not([data-connection=live])")
        assert [each for each in found(hand.page) if "contrast" not in each] == []  # grey on purpose


@pytest.fixture
def report() -> str:
    history = killed(good(), "kinematics", 20.0, 9.0)
    return html("chaos", ["Seed 7."], [*checked(history)], history)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_on_the_report(browser: Any, report: str, scheme: str) -> None:
    with closing(browser.new_context(color_scheme=scheme)) as context:
        page = context.new_page()
        page.set_content(report)
        assert found(page) == []


@pytest.mark.parametrize("width", [320, 390, 844, 1280])
def test_report_is_read_without_moving_its_tables(browser: Any, report: str, width: int) -> None:
    with closing(browser.new_context(viewport={"width": width, "height": 844})) as context:
        page = context.new_page()
        page.set_content(report)
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
