"""The supervised programs: ``deploy/supervisord.conf`` lists those of the arm, a user's file adds others.

A user's file (``MANIFEST=robot.conf make run``) has a section for each program, and no other sections::

    [program:joint_source]
    command = python3 -m services.examples.joint_source

Each program is a service (:func:`interfaces.service.run`). Its node gets the program's name and the parameter
file of the arm, the section gets the settings of our programs where it has none. Modules beside the file are
found.
"""

from __future__ import annotations

import configparser
import importlib.util
import os
import re
import shlex
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from tempfile import mkstemp
from typing import NamedTuple

from deploy.running.errors import DeploymentError

PATH = Path(__file__).resolve().parents[1] / "supervisord.conf"
VARIABLE = "REACTIVE_ARM_MANIFEST"
"""Environment variable: the manifest of a system, if that is not ours."""
GROUP = "arm"
"""The supervisor group of all programs."""
SENTINEL = "sentinel"
"""The program that supervises the others together with supervisord."""
PAGE = "operator_page"
"""The program that serves the operator's page."""
VIRTUAL_JOINTS = ("config_theta1", "config_theta2", "drive")
"""The programs that real joints with a real drive replace."""
_ARGUMENTS = "--ros-args -r __node:={name} --params-file parameters.yaml"


class Program(NamedTuple):
    name: str
    """Also the name of its node."""
    module: str
    arguments: tuple[str, ...]
    """The arguments before ``--ros-args``."""


def path() -> Path:
    """Return the manifest of the system in whose environment this process is."""
    return Path(os.environ.get(VARIABLE) or PATH)


def programs(path_: Path | None = None) -> tuple[Program, ...]:
    """Return the programs in the order of the group."""
    manifest = _read(path_ or path())
    return tuple(_program(name, manifest[f"program:{name}"]["command"]) for name in _names(manifest))


@cache
def start_retries(program: str) -> int:
    """Return after how many early ends supervisord gives a program up."""
    return _read(PATH).getint(f"program:{program}", "startretries")


@contextmanager
def chosen(own: str, without: Collection[str] = ()) -> Iterator[None]:
    """Let :func:`path` be a manifest with the programs of a user's file, while a system starts.

    :param own: the user's file, '' for none.
    :param without: the programs of ours that do not run.
    :raises DeploymentError: for an error in the file.
    """
    if not own and not without:
        yield
        return
    manifest = _read(PATH)
    for name in without:
        manifest.remove_section(f"program:{name}")
    names = [name for name in _names(manifest) if name not in without]
    if own:
        names += _add(manifest, Path(own))
    manifest[f"group:{GROUP}"]["programs"] = ", ".join(names)
    handle, name = mkstemp(".conf")
    os.environ[VARIABLE] = name
    try:
        with open(handle, "w", encoding="utf-8") as file:
            manifest.write(file)
        yield
    finally:
        with suppress(FileNotFoundError):  # the system has moved it to its run directory
            os.unlink(name)


def _add(manifest: configparser.RawConfigParser, path: Path) -> list[str]:
    """Add the programs of a user's file, and return their names."""
    folder = str(path.resolve().parent)
    sys.path.append(folder)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (os.environ.get("PYTHONPATH"), folder)))
    own = _read_own(path)
    ours = set(_names(_read(PATH)))
    shared = {key: value for key, value in manifest[f"program:{SENTINEL}"].items() if key != "command"}
    for section in own.sections():
        kind, _, name = section.partition(":")
        if problem := _problem(kind, name, own[section].get("command", ""), ours):
            raise DeploymentError(f"{path}: [{section}] {problem}")
        manifest[section] = shared | dict(own[section])
        manifest[section]["command"] += f" {_ARGUMENTS.format(name=name)}"
    return [section.partition(":")[2] for section in own.sections()]


def _read_own(path: Path) -> configparser.RawConfigParser:
    try:
        with path.open(encoding="utf-8") as file:
            manifest = configparser.RawConfigParser(inline_comment_prefixes=(" ;",))
            manifest.read_file(file, str(path))
    except OSError as error:
        raise DeploymentError(f"MANIFEST={path}: {error.strerror}") from None
    except (configparser.Error, UnicodeError) as error:
        raise DeploymentError(f"{path}: {' '.join(str(error).split())}") from None
    if not manifest.sections():
        raise DeploymentError(f"{path}: names no program: add [program:NAME] with a command")
    return manifest


def _problem(kind: str, name: str, command: str, ours: Collection[str]) -> str:
    """Return what is wrong with a section of a user's file; empty if nothing is."""
    if kind != "program":
        return "is no [program:NAME]: the file may have no other sections"
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        return "has no name of a node: letters, digits and _"
    if name in ours:
        return "has the name of a program of the arm: take another name"
    try:
        module = _program(name, command).module
    except (ValueError, IndexError):
        return f"has no command such as python3 -m MODULE: {command!r}"
    with suppress(ImportError, ValueError):
        if importlib.util.find_spec(module):
            return ""
    return f"runs the module {module}, which is neither installed nor beside the file"


def _names(manifest: configparser.RawConfigParser) -> list[str]:
    return manifest[f"group:{GROUP}"]["programs"].replace(",", " ").split()


def _read(path: Path) -> configparser.RawConfigParser:
    manifest = configparser.RawConfigParser(inline_comment_prefixes=(" ;",))
    manifest.read(path, encoding="utf-8")
    return manifest


def _program(name: str, command: str) -> Program:
    words = shlex.split(command)
    if "--ros-args" in words:
        words = words[: words.index("--ros-args")]
    module = words.index("-m") + 1
    return Program(name, words[module], tuple(words[module + 1 :]))
