"""Which host a process runs on."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from interfaces.seam import replaceable

_BOOT, _NETWORK = Path("/proc/sys/kernel/random/boot_id"), "/proc/self/ns/net"


@replaceable
def identity() -> str:
    """Return the identifier of this host: the same for all its processes for as long as it runs.

    A host is a network namespace of a running kernel, as for the claims of services
    (:mod:`interfaces.service.instance`). Two hosts may have one name, and a name may change.
    """
    return hashlib.sha256(f"{_BOOT.read_text()}{os.stat(_NETWORK).st_ino}".encode()).hexdigest()[:16]
