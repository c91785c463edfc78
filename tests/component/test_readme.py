"""The README agrees with the code."""

from __future__ import annotations

import re
from pathlib import Path

from interfaces import topics

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


def test_contract_table_is_current() -> None:
    assert topics.markdown() in README


def test_graph_shows_the_publishers_of_each_topic() -> None:
    arrows = re.findall(r"^ +(\w+) -- (\S+) -->", README, re.MULTILINE)
    drawn = {(topic, publisher) for publisher, topic in arrows}
    promised = {(topic.name, name) for topic in topics.CONTRACT for name in topic.publishers}
    assert drawn == {pair for pair in promised if pair[0] != topics.DIAGNOSTICS.name}


def test_named_folders_exist() -> None:
    table = README[README.index("| place |") :]
    for place in re.findall(r"^\| `([\w/.]+)` \|", table, re.MULTILINE):
        assert (ROOT / place).is_dir() or place == ".run/"


def test_named_make_targets_exist() -> None:
    targets = re.findall(r"^([a-z ]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert set(re.findall(r"make ([a-z]+)", README)) <= {name for names in targets for name in names.split()}
