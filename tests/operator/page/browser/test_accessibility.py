"""axe finds nothing to complain about, on the page and on the report."""

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


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_on_the_report(browser: Any, scheme: str) -> None:
    history = killed(good(), "kinematics", 20.0, 9.0)
    findings = [*checked(history)]
    with closing(browser.new_context(color_scheme=scheme)) as context:
        page = context.new_page()
        page.set_content(html("chaos", ["Seed 7."], findings, history))
        assert found(page) == []
