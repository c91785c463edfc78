"""What the services are started with, checked before anything starts."""

from __future__ import annotations

import os
import time
from pathlib import Path

import yaml

from deploy.processes import ROOT
from deploy.system import DeploymentError, System
from interfaces import scenario

SCENARIOS = ROOT / "deploy" / "scenarios"
PROCESSES = 10  # that start at the same time
SETTLING = 2.5  # s in which they find each other and report


def of_scenario(name: str, loading: float) -> dict[str, object]:
    """
    The ROS parameters of all services for a scenario, a name or a file. Raises DeploymentError.

    Its origin lies so far ahead that all of them are up by then: `loading` [s] is what it took to load rclpy
    here, just now, and each of them has to do that too.
    """
    _check_domain()
    path = _scenario_file(name)
    try:
        scenario.load(path)
    except scenario.ScenarioError as error:
        raise DeploymentError(str(error)) from error
    lead = SETTLING + loading * PROCESSES / (os.cpu_count() or 1)
    shared = {"scenario": str(path), "scenario_epoch": round(time.monotonic() + lead, 3)}
    return {"/**": {"ros__parameters": shared}}


def epoch_of(system: System) -> float:
    """The origin of the running system's scenario [s, monotonic clock]."""
    return float(yaml.safe_load(system.parameters.read_text())["/**"]["ros__parameters"]["scenario_epoch"])


def _scenario_file(name: str) -> Path:
    for path in (Path(name), SCENARIOS / f"{name}.yaml"):
        if path.is_file():
            return path.resolve()
    known = ", ".join(sorted(path.stem for path in SCENARIOS.glob("*.yaml")))
    raise DeploymentError(f"SCENARIO={name} is neither a file nor one of: {known}")


def _check_domain() -> None:
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not domain.isdecimal() or int(domain) > 232:
        raise DeploymentError(f"ROS_DOMAIN_ID={domain} is not a number from 0 to 232")
