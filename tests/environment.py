"""The environment of the programs that a user starts, unlike that of the tests' own nodes."""

from __future__ import annotations

import os

from interfaces.service.middleware import PROFILES, RANGE


def user_environment() -> dict[str, str]:
    """Return this environment as in a shell: without what conftest.py sets against shared memory."""
    own = {name: value for name, value in os.environ.items() if name != PROFILES}
    return own | ({RANGE: "LOCALHOST"} if own[RANGE] == "SYSTEM_DEFAULT" else {})
