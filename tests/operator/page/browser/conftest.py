"""An arm, its page in a Chromium, and a record of its topics; the tests of a module share them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

from . import chromium
from .arm import LINK, Arm
from .chromium import HandOnPage
from .link import Link


@pytest.fixture(scope="module")
def playwright() -> Iterator[Any]:
    """Playwright; first of all, because the tests are skipped without it."""
    with chromium.playwright() as started:
        yield started


@pytest.fixture(scope="module")
def arm(playwright: Any, tmp_path_factory: pytest.TempPathFactory, module_domain_id: int) -> Iterator[Arm]:
    run = tmp_path_factory.mktemp("arm") / "run"
    with closing(Arm(run, module_domain_id, names=f"127.0.0.1 {LINK}")) as arm:
        yield arm


@pytest.fixture(scope="module")
def browser(playwright: Any) -> Iterator[Any]:
    with chromium.launched(playwright) as browser:
        yield browser


@pytest.fixture
def own_browser(playwright: Any) -> Iterator[Any]:
    with chromium.launched(playwright) as browser:
        yield browser


@pytest.fixture
def hand(arm: Arm, browser: Any, request: pytest.FixtureRequest) -> Iterator[HandOnPage]:
    """A hand in front of a page of its own; as an indirect parameter a script that runs before the page's."""
    with closing(browser.new_context(has_touch=True)) as context:
        yield HandOnPage(context, arm.url, *([request.param] if hasattr(request, "param") else []))


@pytest.fixture
def link(arm: Arm) -> Iterator[Link]:
    with closing(Link(LINK, ("127.0.0.1", arm.port))) as link:
        yield link
