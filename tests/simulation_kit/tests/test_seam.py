"""The seam between rclpy's Python code and its C extension, on the release at hand."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest
import rclpy

from rclpy_ground import seam
from rclpy_ground.genuine import NAME, genuine

PLACE = Path(rclpy.__path__[0])
TABLE = Path(__file__).parents[3] / "deploy" / "ground" / "SEAM.md"


def test_the_table_has_the_names_of_this_release() -> None:
    assert TABLE.read_text() == f"{seam.table()}\n", (
        "SEAM.md is out of date: replace it with the output of deploy/commands/venv.sh -m rclpy_ground.seam"
    )
    seam.check()


def test_names_that_the_substitute_does_not_know_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(genuine, "rclpy_new", len, raising=False)
    monkeypatch.setattr(genuine, "Newer", len, raising=False)
    with pytest.raises(ImportError, match=r"knows Jazzy and Kilted, but not .*: Newer, rclpy_new$"):
        seam.check()


def used_names() -> set[str]:
    """Return the names that rclpy's Python code reads from its extension."""
    aliases = ("_rclpy", "rclpy_implementation", "impl")
    return {
        node.attr
        for path in PLACE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in aliases
    }


def test_every_name_that_rclpy_uses_is_there() -> None:
    module = sys.modules[f"rclpy.{NAME}"]
    used = used_names()
    assert len(used) > 80
    # Names that this release uses, but its own extension has not, belong to code that never runs.
    assert {name for name in used if not hasattr(module, name) and hasattr(genuine, name)} == set()


def test_what_communicates_or_waits_is_not_the_extension() -> None:
    module = sys.modules[f"rclpy.{NAME}"]
    genuine_ones = {name for name in seam.exported() if getattr(module, name) is getattr(genuine, name)}
    assert genuine_ones <= set(seam.GENUINE)
