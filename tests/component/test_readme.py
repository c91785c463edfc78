"""What the README shows is so."""

from __future__ import annotations

import re
from pathlib import Path

from interfaces import topics

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


def test_the_contract_is_the_one_that_the_services_keep() -> None:
    assert topics.markdown() in README


def test_the_picture_shows_who_publishes_each_topic() -> None:
    arrows = re.findall(r"^ +(\w+) -- (\S+) -->", README, re.MULTILINE)
    drawn = {(topic, publisher) for publisher, topic in arrows}
    promised = {(topic.name, name) for topic in topics.CONTRACT for name in topic.publishers}
    assert drawn == {pair for pair in promised if pair[0] != topics.DIAGNOSTICS.name}


def test_each_place_that_it_names_is_there() -> None:
    table = README[README.index("| place |") :]
    for place in re.findall(r"^\| `([\w/.]+)` \|", table, re.MULTILINE):
        assert (ROOT / place).is_dir() or place == ".run/"


def test_each_command_that_it_names_is_there() -> None:
    targets = re.findall(r"^([a-z ]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert set(re.findall(r"make ([a-z]+)", README)) <= {name for names in targets for name in names.split()}
