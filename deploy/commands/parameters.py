"""What the services are started with, checked before anything starts."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml
from rclpy.exceptions import InvalidNamespaceException
from rclpy.validate_namespace import validate_namespace

from deploy.supervision.processes import ROOT
from deploy.supervision.system import NAMESPACE, SETTINGS, Check, DeploymentError, System, namespace_of
from interfaces.scenario import scenario_file
from interfaces.service import UserError

SCENARIOS = ROOT / "deploy" / "scenarios"
PROCESSES = 10  # that start at the same time
SETTLING = 3.0  # s in which they find each other and report
ALL, KEY = "/**", "ros__parameters"  # the form of ROS 2's parameter files


def of_system(scenario_name: str, user_file: str, loading: float, check: Check) -> dict[str, Any]:
    """
    The content of the parameter file of all services. Raises DeploymentError for any mistake of the user's.

    The scenario's origin lies so far ahead that all services are up by then: `loading` [s] is what it took to
    load rclpy and make a node here, just now, and each of them has to do that too.

    :param scenario_name: name or file of a scenario
    :param user_file: a parameter file, '' for none
    :param check: called again and again while the file is read; what it raises ends that
    """
    path = _scenario_file(scenario_name)
    try:
        scenario_file.load(path)
    except UserError as error:
        raise DeploymentError(str(error)) from error
    given = _checked(user_file, namespace_of(os.environ), check) if user_file else {}
    origin = time.monotonic() + SETTLING + loading * PROCESSES / (os.cpu_count() or 1)
    shared = {"scenario": str(path), "scenario_epoch": round(origin, 3), "settings": SETTINGS}
    return {ALL: {KEY: given.pop(ALL, {KEY: {}})[KEY] | shared}, **given}


def epoch_of(system: System) -> float:
    """The origin of the running system's scenario [s, monotonic clock]."""
    return float(yaml.safe_load(system.parameters.read_text())[ALL][KEY]["scenario_epoch"])


def _scenario_file(name: str) -> Path:
    for path in (Path(name), SCENARIOS / f"{name}.yaml"):
        if path.is_file():
            return path.resolve()
    known = ", ".join(sorted(path.stem for path in SCENARIOS.glob("*.yaml")))
    raise DeploymentError(f"SCENARIO={name} is neither a file nor one of: {known}")


def program_of(node: str, namespace: str) -> str:
    """The program of a node that a parameter file of an arm names: with the arm's namespace, or without."""
    return node.removeprefix(namespace.rstrip("/") + "/")


def _checked(user_file: str, namespace: str, check: Check) -> dict[str, Any]:
    """What a user's file says, with the full name of each node: ROS applies no other in a namespace."""
    command = [sys.executable, "-m", "deploy.commands.parameter_file", user_file]
    said = None
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as reader:
        try:
            while said is None:
                check()
                with suppress(subprocess.TimeoutExpired):
                    said, complaint = reader.communicate(timeout=0.1)
        finally:
            reader.kill()
    check()  # a Ctrl-C ends the reader, too: that is no mistake in the file
    if reader.returncode:
        raise DeploymentError(complaint.strip())
    given = json.loads(said)
    prefix = namespace.rstrip("/") + "/"
    return {node if node == ALL else prefix + program_of(node, namespace): given[node] for node in given}


def check_environment() -> None:
    """Raise DeploymentError for an environment in which no node could live."""
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not domain.isdecimal() or int(domain) > 232:
        raise DeploymentError(f"ROS_DOMAIN_ID={domain} is not a number from 0 to 232")
    namespace = namespace_of(os.environ)
    try:
        validate_namespace(namespace)
    except InvalidNamespaceException as error:
        reason = str(error).splitlines()[0].rstrip(":")
        raise DeploymentError(f"{NAMESPACE}={namespace} is no namespace such as /arm1: {reason}") from None
