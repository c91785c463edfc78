"""The variables of the user's shell that what we run reads, and what becomes of each.

The first row that fits a name decides. What an interpreter reads before any module is up to
deploy/commands/entry.sh. Standard library only: the set-up reads this table.
"""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import NamedTuple

from interfaces import arm_variables

RESPECTED = "respected"
OVERRIDDEN = "overridden"
"""Removed; the arm sets its own value where it needs one."""
REFUSED = "refused"
"""Respected, and a value that cannot be obeyed is refused by name."""


class Variable(NamedTuple):
    names: str
    """with spaces between; `*` stands for any characters"""
    decision: str
    reason: str


TABLE = (
    # Python
    Variable("PYTHON", RESPECTED, "is make's own: the interpreter of .venv"),
    Variable("PYTHONPATH", RESPECTED, "has a sourced ROS 2; without one, it comes after what the arm needs"),
    Variable("PYTHONDONTWRITEBYTECODE PYTHONPYCACHEPREFIX", RESPECTED, "say where compiled code goes"),
    Variable("PYTHONNOUSERSITE PYTHONUSERBASE", RESPECTED, "count only beside a sourced ROS 2, as there"),
    Variable("PYTHONFAULTHANDLER", RESPECTED, "changes nothing but the words about a crash"),
    Variable("PYTHONHOME PYTHONPLATLIBDIR PYTHONEXECUTABLE", OVERRIDDEN, "belong to another interpreter"),
    Variable("PYTHONSAFEPATH", OVERRIDDEN, "hides the checkout from `python -m`"),
    Variable("PYTHONOPTIMIZE", OVERRIDDEN, "removes assertions, which libraries rely on"),
    Variable("PYTHONWARNINGS PYTHONDEVMODE", OVERRIDDEN, "make errors of the warnings of libraries"),
    Variable("PYTHONINSPECT PYTHONSTARTUP", OVERRIDDEN, "are for a hand at a prompt: no program would end"),
    Variable("PYTHONUNBUFFERED", OVERRIDDEN, "is 1 for services: their logs show each line at once"),
    Variable("PYTHON*", OVERRIDDEN, "is for debugging an interpreter, not known yet, or slows each start"),
    # pip, in the set-up
    Variable("PIP_INDEX_URL PIP_EXTRA_INDEX_URL PIP_NO_INDEX PIP_FIND_LINKS", RESPECTED, "name a mirror"),
    Variable("PIP_PROXY PIP_TRUSTED_HOST PIP_CERT PIP_CLIENT_CERT", RESPECTED, "are the way to it"),
    Variable("PIP_KEYRING_PROVIDER PIP_USE_FEATURE PIP_CONFIG_FILE", RESPECTED, "are the way to it"),
    Variable("PIP_TIMEOUT PIP_DEFAULT_TIMEOUT PIP_RETRIES PIP_RESUME_RETRIES", RESPECTED, "suit a slow line"),
    Variable("PIP_CACHE_DIR PIP_NO_CACHE_DIR", RESPECTED, "say where downloads are kept"),
    Variable("PIP_*", OVERRIDDEN, "changes what is installed, or where: the requirements say that"),
    # supervisor, and the process table
    Variable("SUPERVISOR_*", OVERRIDDEN, "is of a supervisord above this shell: ours has no program's name"),
    Variable(arm_variables.SYSTEM, OVERRIDDEN, "marks the processes of an arm, and this shell is none"),
    # rcl, rmw, Fast DDS, Cyclone DDS
    Variable("ROS_LOCALHOST_ONLY", OVERRIDDEN, "is older than the range LOCALHOST, which 1 stands for"),
    Variable("ROS_LOG_DIR ROS_HOME", OVERRIDDEN, "name places outside of the arm, which nobody empties"),
    Variable("ROS_DOMAIN_ID ROS_AUTOMATIC_DISCOVERY_RANGE", REFUSED, "choose who meets"),
    Variable("ROS_SECURITY_ENABLE ROS_SECURITY_STRATEGY", REFUSED, "close an arm, or nothing starts"),
    Variable(
        "ROS_SECURITY_ENCLAVE_OVERRIDE", OVERRIDDEN, "is for `ros2` in the same shell: programs have theirs"
    ),
    Variable("RUNTIME RMW_IMPLEMENTATION", REFUSED, "choose rclpy and its DDS"),
    Variable("ROS_* RMW_* RCL_* RCUTILS_* AMENT_PREFIX_PATH", RESPECTED, "are ROS 2's own settings"),
    Variable("FASTRTPS_DEFAULT_PROFILES_FILE", REFUSED, "has the settings of Fast DDS instead of ours"),
    Variable(
        "FASTRTPS_* FASTDDS_* SKIP_DEFAULT_XML", RESPECTED, "are settings of Fast DDS, if the user has any"
    ),
    Variable("CYCLONEDDS_*", RESPECTED, "are settings of Cyclone DDS, if the user has any"),
    # make, the shell, the loader, libraries
    Variable("MAKEFLAGS MAKEFILES GNUMAKEFLAGS", RESPECTED, "are read before the Makefile"),
    Variable("CDPATH", OVERRIDDEN, "leads `cd` to another checkout"),
    Variable("HOME XDG_CONFIG_HOME", RESPECTED, "are where `make unit` writes; nothing else needs them"),
    Variable("LD_LIBRARY_PATH", RESPECTED, "comes after the libraries of the rclpy in .venv"),
    Variable("LD_* GLIBC_TUNABLES MALLOC_*", RESPECTED, "change all programs of the shell, on purpose"),
    Variable("OPENBLAS_NUM_THREADS", OVERRIDDEN, "is 1: supervisord forks, and numpy must start no threads"),
    Variable("NOTIFY_SOCKET WATCHDOG_USEC", RESPECTED, "are systemd's, which hears of the arm by them"),
    Variable("PATH TMPDIR LANG LC_* TZ *_proxy *_PROXY SSL_CERT_*", RESPECTED, "describe machine and user"),
)


def decision(name: str) -> str:
    """Return what becomes of a variable; one that no row fits is respected."""
    rows = (row for row in TABLE if any(fnmatchcase(name, pattern) for pattern in row.names.split()))
    return next(rows, Variable(name, RESPECTED, "")).decision


def kept(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment without what is overridden."""
    return {name: value for name, value in environment.items() if decision(name) != OVERRIDDEN}
