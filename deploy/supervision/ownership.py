"""The owner of a run directory: a user who can write in it commands the arm, and chooses the page's token.

Standard library only: `make stop` works without .venv.
"""

from __future__ import annotations

import os
import pwd
import stat
from collections.abc import Iterator
from pathlib import Path

from deploy.supervision.errors import DeploymentError
from deploy.supervision.processes import ROOT, RUN_DIRECTORY

_REMEDY = f"set {RUN_DIRECTORY} to a directory of your own"


def check(run: Path) -> None:
    """Raise DeploymentError if another user can write in a run directory, or put another one in its place.

    The folders above the checkout are not checked: a user who can replace the code needs no run directory.
    """
    try:
        status = os.stat(run)
    except (FileNotFoundError, NotADirectoryError):  # it is made later, or cannot be made
        return
    if status.st_uid != os.geteuid():
        raise DeploymentError(
            f"The run directory {run} belongs to {_words(status)}:"
            f" {_REMEDY}, or run this command as {name_of(status.st_uid)}"
        )
    if _is_open(status):
        raise DeploymentError(f"The run directory {run} is open to others, {_words(status)}: chmod 700 {run}")
    for step in _steps(run):
        if step in (ROOT, *ROOT.parents):
            continue
        status = os.lstat(step)
        is_safe = stat.S_ISLNK(status.st_mode) or status.st_mode & stat.S_ISVTX or not _is_open(status)
        if not is_safe or status.st_uid not in (os.geteuid(), os.stat("/").st_uid):  # of root
            owner = f"{step} belongs to {_words(status)}"
            raise DeploymentError(f"The run directory {run} can be replaced by others, {owner}: {_REMEDY}")


def name_of(user: int) -> str:
    """Return the name of a user; a container may have none for it."""
    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return f"user {user}"


def _words(status: os.stat_result) -> str:
    return f"{name_of(status.st_uid)} (uid {status.st_uid}, mode {stat.S_IMODE(status.st_mode):04o})"


def _is_open(status: os.stat_result) -> bool:
    """Whether others can write: all of them, or a group that is not the user's own."""
    by_group = (status.st_mode & stat.S_IWGRP) and status.st_gid != os.getegid()
    return bool(by_group or status.st_mode & stat.S_IWOTH)


def _steps(path: Path) -> Iterator[Path]:
    """Yield each folder and symbolic link on the way to an existing path."""
    for step in (*reversed(path.parents), path):
        yield step
        if step.is_symlink():
            yield from _steps(step.parent / step.readlink())
