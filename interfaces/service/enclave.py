"""The enclave with which a process joins where ROS 2's ROS_SECURITY_ENABLE asks for security (SROS2)."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

from interfaces.service.errors import UserError

ENABLE = "ROS_SECURITY_ENABLE"
"""Environment variable: ROS 2 secures DDS if it is ``true``."""
KEYSTORE = "ROS_SECURITY_KEYSTORE"
"""Environment variable: the folder of the keystore."""
SOON = timedelta(days=14)
"""Processes warn of keys that end so soon, and `make keystore` renews them."""
_VALIDITY = re.compile(r"<not_before>(.*?)</not_before>\s*<not_after>(.*?)</not_after>", re.DOTALL)


class Keys(NamedTuple):
    """The keys of an enclave, as a process has read them when it joined."""

    enclave: str
    begin: datetime
    end: datetime

    def problem(self, now: datetime) -> str:
        """Return why nobody joins with these keys at a time; '' if they are valid."""
        if now >= self.end:
            return (
                f"the keys of {self.enclave} have ended at {self.end:%Y-%m-%d %H:%M} UTC:"
                " make keystore, then make stop and start"
            )
        if now < self.begin:
            return (
                f"the keys of {self.enclave} begin at {self.begin:%Y-%m-%d %H:%M} UTC,"
                f" and this host's clock says {now:%Y-%m-%d %H:%M}: set it"
            )
        return ""

    def warning(self, now: datetime) -> str:
        """Return when the keys end, if that is soon; '' if it is not."""
        left = self.end - now
        if left >= SOON:
            return ""
        hours = left // timedelta(hours=1)
        amount = f"{hours // 24} days" if hours >= 48 else f"{hours} hours"
        return f"they end in {amount}, and the arm with them: make keystore, then make stop and start"


def path(name: str, namespace: str) -> str:
    """Return the enclave of a name in the namespace of an arm, for example ``/arm1/kinematics``."""
    return f"{namespace.rstrip('/')}/{name}"


def arguments(name: str, namespace: str) -> list[str]:
    """Return the arguments of rclpy.init() that choose the enclave of a name; none without security.

    :raises UserError: if its keys are not valid now.
    """
    if not _is_wanted():
        return []
    enclave = path(name, namespace)
    if (found := keys(enclave)) and (problem := found.problem(datetime.now(UTC))):
        raise UserError(problem)
    return ["--ros-args", "--enclave", enclave]


def keys(enclave: str) -> Keys | None:
    """Return the keys of an enclave in the keystore of this environment.

    ``None`` without security, or if its permissions have no validity: rclpy reports what is wrong with them.
    """
    if not _is_wanted():
        return None
    permissions = Path(os.environ.get(KEYSTORE, ""), "enclaves", enclave.lstrip("/"), "permissions.p7s")
    with suppress(OSError, ValueError):  # ValueError: no text, or no times
        if found := _VALIDITY.search(permissions.read_text()):
            return Keys(enclave, *(_utc(datetime.fromisoformat(text.strip())) for text in found.groups()))
    return None


def _is_wanted() -> bool:
    return os.environ.get(ENABLE) == "true"  # no other spelling counts, as in ROS 2


def _utc(time: datetime) -> datetime:
    return time if time.tzinfo else time.replace(tzinfo=UTC)
