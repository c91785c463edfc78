"""The README agrees with the code."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

from deploy.commands.parameter_file import USE_SIM_TIME, declared
from interfaces import topics

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
CONTRACT = README if topics.TF in topics.CONTRACT else re.sub(r".*/tf.*\n", "", README)
"""What the README shows of the contract: without `/tf`, where tf2_msgs is not installed."""


def test_contract_table_is_current() -> None:
    (table,) = re.findall(r"^\| topic \|.*?\n(?=\n)", CONTRACT, re.MULTILINE | re.DOTALL)
    assert table == topics.markdown()


def test_graph_shows_the_publishers_of_each_topic() -> None:
    arrows = re.findall(r"^ +(\w+) -- (\S+) -->", CONTRACT, re.MULTILINE)
    drawn = {(topic, publisher) for publisher, topic in arrows}
    promised = {(topic.name, name) for topic in topics.CONTRACT for name in topic.publishers}
    assert drawn == {pair for pair in promised if pair[0] != topics.DIAGNOSTICS.name}


def test_parameter_table_is_current() -> None:
    rows = [
        f"| {program} | `{each.name}` | {_shown(each.default)} | {_range(each.within)} | {each.unit} "
        f"| {'yes' if each.settable else ''} | {each.meaning} |"
        for program, parameters in declared().items()
        for each in parameters.values()
        if each != USE_SIM_TIME
    ]
    assert re.findall(r"^\| \w+ \| `\w+` \| .*\|$", README, re.MULTILINE) == rows, "\n".join(rows)


def _shown(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _range(within: tuple[object, object] | None) -> str:
    return f"{_shown(within[0])} to {_shown(within[1])}" if within else ""


def test_shown_recipe_is_the_one_of_the_watchdog() -> None:
    (recipe,) = re.findall(r"```python\n(alive = .*?)```", README, re.DOTALL)
    assert textwrap.indent(recipe, " " * 8) in (ROOT / "services" / "operator_watchdog.py").read_text()


def test_named_folders_and_linked_files_exist() -> None:
    table = README[README.index("| place |") :]
    places = re.findall(r"^\| `([\w/.]+)` \|", table, re.MULTILINE)
    links = re.findall(r"\]\(([^)]+)\)", README)
    named = [*places, *(link for link in links if "#" not in link and "://" not in link)]
    assert [name for name in named if name != ".run/" and not (ROOT / name).exists()] == []


def test_named_make_targets_exist() -> None:
    targets = re.findall(r"^([a-z ]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert set(re.findall(r"make ([a-z]+)", README)) <= {name for names in targets for name in names.split()}
