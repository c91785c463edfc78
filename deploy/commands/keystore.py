"""`make keystore`: writes the keys of an arm, and copies those of one host."""

from __future__ import annotations

import os
from pathlib import Path

from deploy.security import rights
from deploy.security.keystore import Keystore
from deploy.supervision import manifest
from deploy.supervision.environment import KEYSTORE, namespace_of
from deploy.supervision.errors import DeploymentError
from interfaces.service.enclave import path


def write(export: str, names: str) -> None:
    """Write an enclave for each program, for the sentinels of two hosts, terminal, recorder, tools and fleet.

    :param export: a new folder for the keys of one host, '' for none.
    :param names: of the enclaves of that host, with spaces between; `/fleet` is in no namespace.
    :raises DeploymentError: if that fails.
    """
    if not os.environ.get(KEYSTORE):
        raise DeploymentError(f"{KEYSTORE} is not set: it names the folder of the keystore")
    if bool(export) != bool(names.split()):
        raise DeploymentError(
            'An export needs both: make keystore EXPORT=folder ENCLAVES="terminal sentinel"'
        )
    keystore = Keystore(Path(os.environ[KEYSTORE]))
    namespace, domain = namespace_of(os.environ), int(os.environ.get("ROS_DOMAIN_ID") or 0)
    programs = [*(program.name for program in manifest.programs()), *manifest.sentinels()]
    arm = rights.of_arm(namespace, programs)
    end = keystore.write(arm, [domain])
    until = f"valid until {end:%Y-%m-%d}"
    print(f"{keystore.folder}: {len(arm)} enclaves for ROS domain {domain}, namespace {namespace}, {until}")
    if export:
        enclaves = [name if name.startswith("/") else path(name, namespace) for name in names.split()]
        keystore.export(Path(export), enclaves)
        print(f"{export}: {', '.join(enclaves)}; copy this folder to their host")
