from __future__ import annotations

import re
import textwrap

import pytest

from deploy.commands import tables
from deploy.supervision.processes import ROOT

PAGES = (
    "README.md",
    "CONTRIBUTING.md",
    "deploy/README.md",
    "deploy/SAFETY.md",
    "tests/benchmarks/README.md",
    "interfaces/README.md",
    "services/README.md",
    "tests/README.md",
)
RECIPES = {
    "README.md": "services/operator_watchdog.py",
    "services/README.md": "services/examples/speed_guard.py",
}
"""The file that has the recipe of a page."""


def text_of(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def programs_of(page: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", text_of(page), re.DOTALL)


def test_first_page_is_one_screen() -> None:
    assert text_of("README.md").count("\n") <= 120


@pytest.mark.parametrize("page", tables.PAGES)
def test_tables_and_graph_are_current(page: str) -> None:
    shown = text_of(page)
    assert shown == tables.updated(page, shown)


@pytest.mark.parametrize("page", RECIPES)
def test_shown_recipe_is_the_one_of_the_service(page: str) -> None:
    code = (ROOT / RECIPES[page]).read_text()
    recipe = programs_of(page)[0]
    assert any(textwrap.indent(recipe, " " * depth) in code for depth in (0, 4, 8))


def test_shown_simulation_is_a_part_of_the_tested_example() -> None:
    shown = programs_of("README.md")[-1]
    examples = programs_of("tests/simulation_kit/README.md")
    assert any(_lines(shown) <= _lines(example) for example in examples)


def _lines(program: str) -> set[str]:
    """Return the lines of a program without their remarks."""
    return {line.partition("  #")[0] for line in program.splitlines()}


@pytest.mark.parametrize("page", PAGES)
def test_linked_files_exist(page: str) -> None:
    links = [link.partition("#")[0] for link in re.findall(r"\]\(([^)]+)\)", text_of(page))]
    folder = (ROOT / page).parent
    assert [link for link in links if "://" not in link and not (folder / link).exists()] == []


@pytest.mark.parametrize("page", PAGES)
def test_named_commands_of_make_exist(page: str) -> None:
    targets = re.findall(r"^([a-z -]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    known = {name for names in targets for name in names.split()}
    assert set(re.findall(r"(?:`|^ +|[A-Z]=\S+ )make ([a-z-]+)", text_of(page), re.MULTILINE)) <= known
