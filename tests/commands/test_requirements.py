"""The pinned requirements: complete, and within the ranges that the projects declare."""

from __future__ import annotations

import re
import tomllib

import pytest
from packaging.requirements import Requirement

from deploy.supervision.processes import ROOT

FILES = ("system", "build", "develop", "cyclonedds", "ros")
PROJECTS = {
    "tests/simulation_kit": ("develop",),
    "deploy/tools": ("system", "ros"),
}
"""Distributions of this repository, and the files with what they need."""


def lines(name: str) -> list[str]:
    text = (ROOT / f"deploy/requirements/{name}.txt").read_text().replace("\\\n", "")
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def pins(*names: str) -> dict[str, str]:
    pairs = [line.split()[0].split("==") for name in names for line in lines(name)]
    return {name.lower().replace("_", "-"): version for name, version in pairs}


def unmet(declared: list[str], pinned: dict[str, str]) -> list[str]:
    requirements = [Requirement(text) for text in declared]
    return [str(each) for each in requirements if pinned.get(each.name.lower(), "none") not in each.specifier]


def test_the_projects_requirements_are_pinned_in_their_ranges() -> None:
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text())["dependency-groups"]
    assert unmet(groups["system"], pins("system")) == []
    assert unmet(groups["ros"], pins("ros")) == []
    assert unmet(groups["develop"], pins("system", "build", "develop")) == []


@pytest.mark.parametrize("project", PROJECTS)
def test_a_distributions_requirements_are_pinned_in_their_ranges(project: str) -> None:
    distribution = tomllib.loads((ROOT / project / "pyproject.toml").read_text())
    assert unmet(distribution["project"]["dependencies"], pins(*PROJECTS[project])) == []
    assert unmet(distribution["build-system"]["requires"], pins("build")) == []


@pytest.mark.parametrize("name", [*FILES, "kilted"])
def test_each_package_has_a_hash_of_each_of_its_files(name: str) -> None:
    for line in lines(name):
        hashes = re.findall(r" --hash=sha256:[0-9a-f]{64}(?= |$)", line)
        assert len(hashes) == len(set(hashes)) > 0, line
        # ROS 2's wheels are for one Python each, of which four are supported, or for all.
        assert not line.startswith("ros-") or len(hashes) == 1 or len(hashes) >= 4, line


def test_a_package_has_the_same_hashes_in_every_file() -> None:
    everything = {line.split("==")[0]: line for name in FILES for line in lines(name)}
    assert all(line == everything[line.split("==")[0]] for name in FILES for line in lines(name))
