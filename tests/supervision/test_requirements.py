"""The pinned requirements: complete, and within the ranges that the projects declare."""

from __future__ import annotations

import tomllib
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]


def pins(*names: str) -> dict[str, str]:
    lines = [
        line for name in names for line in (ROOT / f"deploy/requirements/{name}.txt").read_text().splitlines()
    ]
    pairs = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {name.lower().replace("_", "-"): version for name, version in pairs}


def unmet(declared: list[str], pinned: dict[str, str]) -> list[str]:
    requirements = [Requirement(text) for text in declared]
    return [str(each) for each in requirements if pinned.get(each.name.lower(), "none") not in each.specifier]


def test_the_projects_requirements_are_pinned_in_their_ranges() -> None:
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text())["dependency-groups"]
    for name in ("system", "develop"):
        assert unmet(groups[name], pins(name)) == []


def test_the_runtimes_requirements_are_pinned_in_their_ranges() -> None:
    runtime = tomllib.loads((ROOT / "deploy/runtime/pyproject.toml").read_text())
    pinned = pins("system", "build", "runtime")
    assert unmet(runtime["project"]["dependencies"], pinned) == []
    assert unmet(runtime["build-system"]["requires"], pinned) == []


def test_a_package_has_the_same_version_in_every_file() -> None:
    everything = pins("system", "build", "runtime", "develop")
    for name in ("system", "build", "runtime", "develop"):
        assert pins(name).items() <= everything.items()
