"""The parameters that the services start with; errors in them are reported before anything starts."""

from __future__ import annotations

import os
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rclpy.exceptions import InvalidNamespaceException
from rclpy.validate_namespace import validate_namespace

from deploy.operator.page.address import host_names, tls
from deploy.security.keystore import Keystore
from deploy.security.rights import TERMINAL
from deploy.supervision import manifest, parameter_file, processes
from deploy.supervision.environment import (
    ENFORCE,
    KEYSTORE,
    NAMESPACE,
    RANGE,
    SECURITY,
    STRATEGY,
    is_secured,
    namespace_of,
)
from deploy.supervision.errors import DeploymentError
from deploy.supervision.ownership import name_of
from deploy.supervision.processes import ROOT
from deploy.supervision.run_directory import ALL, KEY, NOT_YET, scenario_parameters
from deploy.supervision.system import System
from interfaces.service import UserError, enclave, instance, middleware
from interfaces.sources import scenario_file

SCENARIOS = ROOT / "deploy" / "scenarios"
NONE = "none"
"""The scenario without virtual joints, drive and operator."""
LIMITS = {
    "operator_watchdog": ("silence", "strikes"),
    "engine_controller": ("max_presence_age", "presence_timeout"),
}
"""The parameters of other services that the page shows."""
WEB = "WEB"  # environment variable: the port of the page, or off


def of_system(scenario_name: str, user_file: str) -> dict[str, Any]:
    """Return the content of the parameter file of all services.

    :param scenario_name: name or file of a scenario.
    :param user_file: a parameter file, '' for none.
    :raises DeploymentError: for an error in one of them.
    """
    path = _scenario_file(scenario_name)
    try:
        if path:
            scenario_file.load(path)
        given = parameter_file.load(user_file, namespace_of(os.environ)) if user_file else {}
    except UserError as error:
        raise DeploymentError(str(error)) from error
    shared = given.pop(ALL, {}).get(KEY, {})
    prefix = namespace_of(os.environ).rstrip("/") + "/"
    page = prefix + manifest.PAGE
    if user_file:
        files = _page_files(user_file, shared | given.get(page, {}).get(KEY, {}))
        if known := files | _limits(given, prefix):
            given.setdefault(page, {KEY: {}})[KEY].update(known)
    parameters: dict[str, Any] = scenario_parameters(path or "", NOT_YET)
    parameters[ALL][KEY] |= shared
    if (port := _port(os.environ.get(WEB, ""))) is not None:
        given.setdefault(page, {KEY: {}})[KEY]["port"] = port
    return parameters | given


def _page_files(user_file: str, given: Mapping[str, Any]) -> dict[str, str]:
    """Return the files of the page; relative paths count from the parameter file. Raises DeploymentError."""
    declared = parameter_file.declared().get(manifest.PAGE)
    if declared is None:  # a system without the page
        return {}
    folder = Path(user_file).resolve().parent
    files = {name: str(folder / given[name]) for name in ("certificate", "key") if given.get(name)}
    host = given.get("address", declared["address"].default)
    try:
        tls(host, files.get("certificate", ""), files.get("key", ""))
        host_names(host, given.get("names", "").split())
    except UserError as error:
        raise DeploymentError(f"{user_file}: {manifest.PAGE}: {error}") from None
    return files


def _limits(given: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Return the parameters of other services that the page shows, as far as they are given."""
    return {
        name: value
        for service, names in LIMITS.items()
        for name, value in given.get(prefix + service, {}).get(KEY, {}).items()
        if name in names
    }


def _port(web: str) -> int | None:
    """The port of the page that WEB asks for; 0 for no page, ``None`` for the default."""
    if web in ("", "off"):
        return 0 if web else None
    if web.isascii() and web.isdecimal() and 0 < int(web) < 65536:
        return int(web)
    raise DeploymentError(f"WEB={web} is neither off nor a port from 1 to 65535")


def _scenario_file(name: str) -> Path | None:
    if name == NONE:
        return None
    for path in (Path(name), SCENARIOS / f"{name}.yaml"):
        if path.is_file():
            return path.resolve()
    known = ", ".join([*sorted(path.stem for path in SCENARIOS.glob("*.yaml")), NONE])
    raise DeploymentError(f"SCENARIO={name} is neither a file nor one of: {known}")


def check_environment(system: System) -> None:
    """Raise DeploymentError for an environment in which the services of a system cannot live."""
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not domain.isdecimal() or int(domain) > 232:
        raise DeploymentError(f"ROS_DOMAIN_ID={domain} is not a number from 0 to 232")
    namespace = namespace_of(os.environ)
    try:
        validate_namespace(namespace)
    except InvalidNamespaceException as error:
        reason = str(error).splitlines()[0].rstrip(":")
        raise DeploymentError(f"{NAMESPACE}={namespace} is no namespace such as /arm1: {reason}") from None
    reach = os.environ.get(RANGE, "")
    if reach.strip().upper() == "OFF":
        raise DeploymentError(f"{RANGE}={reach} keeps the services apart: set LOCALHOST or SUBNET")
    _check_profiles()
    _check_keys(namespace, int(domain))
    if not system.members():  # the start reports a running system, and replaces orphans
        for program in manifest.programs():
            _check_claim(f"{namespace.rstrip('/')}/{program.name}", int(domain), namespace)


def _check_profiles() -> None:
    """Raise DeploymentError if the user's settings of Fast DDS are nowhere: it would go on without any."""
    if (profiles := os.environ.get(middleware.PROFILES)) and middleware.is_fast_dds():
        if not Path(profiles).is_file():
            raise DeploymentError(f"{middleware.PROFILES}={profiles}: there is no such file")
        os.environ[middleware.PROFILES] = str(Path(profiles).absolute())  # services work in the run directory


def _check_keys(namespace: str, domain: int) -> None:
    """Raise DeploymentError if security is wanted, but not for every process, or without valid keys."""
    if not is_secured(os.environ):
        return
    if (strategy := os.environ.get(STRATEGY)) != ENFORCE:
        raise DeploymentError(f"{STRATEGY}={strategy} lets processes join without keys: set it to {ENFORCE}")
    if not os.environ.get(KEYSTORE):
        raise DeploymentError(f"{SECURITY}=true needs {KEYSTORE}: the folder that make keystore wrote")
    keystore = Keystore(Path(os.environ[KEYSTORE]).absolute())
    os.environ[KEYSTORE] = str(keystore.folder)  # the services work in the run directory
    names = [TERMINAL, *(program.name for program in manifest.programs())]
    needed = sorted(enclave.path(name, namespace) for name in names)
    keystore.check(needed, domain)
    for each in map(enclave.keys, needed):
        if each and (problem := each.problem(datetime.now(UTC))):
            raise DeploymentError(problem)


def _check_claim(node: str, domain: int, namespace: str) -> None:
    holders = instance.holders(node, domain)
    if is_secured(os.environ):  # the arm of another user has other keys, and meets ours nowhere
        holders &= {os.geteuid()}
    if not holders:
        return
    others = "" if os.geteuid() in holders else f", started by {name_of(min(holders))}"
    users = (
        f"the system in {run} has {node}"
        for run, environment in processes.systems().items()
        if int(environment.get("ROS_DOMAIN_ID") or 0) == domain and namespace_of(environment) == namespace
    )
    raise DeploymentError(
        f"ROS domain {domain} is in use: {next(users, f'{node} already runs on this host{others}')}."
        f" Set ROS_DOMAIN_ID to another domain (0 to 101), or {NAMESPACE}, for example to /arm2."
    )
