from __future__ import annotations

import re

import pytest

from deploy.supervision.processes import ROOT
from tests.promises.promises import CHECKERS

CASE = (ROOT / "deploy" / "SAFETY.md").read_text(encoding="utf-8")
CITED = sorted(set(re.findall(r"([\w/]*tests/\S+\.py)::(\w+)", CASE)))


@pytest.mark.parametrize(("file", "test"), CITED)
def test_cited_test_exists(file: str, test: str) -> None:
    assert f"\ndef {test}(" in (ROOT / file).read_text(encoding="utf-8")


def test_table_names_every_promise() -> None:
    assert re.findall(r"^\| ([SL]\d) \|", CASE, re.MULTILINE) == list(CHECKERS)


def test_every_claim_has_evidence() -> None:
    claims = re.search(r"## S1, line by line(.*?)## Why the sentinel", CASE, re.DOTALL)
    assert claims
    rows = [
        line for line in claims[1].splitlines() if line.startswith("| ") and not line.startswith("| claim")
    ]
    assert len(rows) > 15
    assert all("tests/" in row.rpartition(" | ")[2] for row in rows)
