"""The supervised programs: ``deploy/supervisord.conf`` lists those of the arm, a user's file adds others.

A user's file (``MANIFEST=robot.conf make run``) has a section for each program, and no other sections::

    [program:joint_source]
    command = python3 -m services.examples.joint_source

A program runs on the host `robot`, unless its section has ``host = operator``. `make start HOST=operator`
starts the programs of that host alone. Each host has a sentinel with a name of its own.

Each program is a service (:func:`interfaces.service.run`). Its node gets the program's name and the parameter
file of the arm. Modules beside the file are found.
"""

from __future__ import annotations

import configparser
import importlib.util
import os
import re
import shlex
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from tempfile import mkstemp
from typing import NamedTuple

from deploy.supervision import processes
from deploy.supervision.errors import DeploymentError
from deploy.supervision.run_directory import PARAMETERS
from interfaces import arm_variables

PATH = Path(__file__).resolve().parents[1] / "supervisord.conf"
VARIABLE = "REACTIVE_ARM_MANIFEST"
"""Environment variable: the manifest of a system, if that is not ours."""
HOST = arm_variables.HOST
ROBOT = "robot"
"""The host of the programs that name none."""
GROUP = "arm"
"""The supervisor group of all programs."""
SENTINEL = "sentinel"
"""The program that supervises the others together with supervisord, where one host runs all."""
PAGE = "operator_page"
"""The program that serves the operator's page."""
VIRTUAL_JOINTS = ("config_theta1", "config_theta2", "drive")
"""The programs that real joints with a real drive replace."""
_ELSEWHERE = "elsewhere:"  # begins the sections of programs of other hosts; supervisor ignores them
_ARGUMENTS = "--ros-args -r __node:={name} --params-file {parameters}"


class Program(NamedTuple):
    name: str
    """Also the name of its node."""
    module: str
    arguments: tuple[str, ...]
    """The arguments before ``--ros-args``."""
    host: str = ROBOT
    """The host that runs it, if there is more than one."""
    starts: bool = True
    """Whether it starts with the system; otherwise the user starts it later (`autostart` of supervisor)."""


def path() -> Path:
    """Return the manifest of the system in whose environment this process is."""
    return Path(os.environ.get(VARIABLE) or PATH)


def programs(path_: Path | None = None) -> tuple[Program, ...]:
    """Return the programs in the order of the group."""
    manifest = _read(path_ or path())
    return tuple(_program(name, manifest[f"program:{name}"]) for name in _names(manifest))


def own() -> set[str]:
    """Return the names of the programs of the user's file."""
    ours = {program.name for program in programs(PATH)} | {*sentinels()}
    return {program.name for program in everywhere()} - ours


def everywhere() -> tuple[Program, ...]:
    """Return the programs of all hosts, those of this host first."""
    manifest = _read(path())
    others = [section for section in manifest.sections() if section.startswith(_ELSEWHERE)]
    return programs() + tuple(
        _program(section.removeprefix(_ELSEWHERE), manifest[section]) for section in others
    )


def sentinel(host: str | None = None) -> str:
    """Return the name of the sentinel of a host, by default of this one."""
    host = os.environ.get(HOST, "") if host is None else host
    return f"{SENTINEL}_{host}" if host else SENTINEL


def sentinels() -> tuple[str, ...]:
    """Return the names of the sentinels of all hosts, where there is more than one."""
    return tuple(sentinel(host) for host in sorted({program.host for program in programs(PATH)}))


@cache
def start_retries(program: str) -> int:
    """Return after how many early ends supervisord gives a program up."""
    return _read(PATH).getint(f"program:{program}", "startretries")


@contextmanager
def chosen(own: str, without: Collection[str] = (), host: str = "") -> Iterator[None]:
    """Let :func:`path` be a manifest with the programs of a user's file, while a system starts.

    :param own: the user's file, '' for none.
    :param without: the programs of ours that do not run.
    :param host: whose programs run here, '' for all.
    :raises DeploymentError: for an error in the file, or a host without programs.
    """
    if not own and not without and not host:
        yield
        return
    manifest = _read(PATH)
    for name in without:
        manifest.remove_section(f"program:{name}")
    names = [name for name in _names(manifest) if name not in without]
    if own:
        names += _add(manifest, Path(own))
    if host:
        names = _part(manifest, names, host)
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


def _part(manifest: configparser.RawConfigParser, names: Sequence[str], host: str) -> list[str]:
    """Mark the programs of other hosts, and return the names of those of a host."""
    hosts = sorted({_host(manifest[f"program:{name}"]) for name in names})
    if host not in hosts:
        raise DeploymentError(f"HOST={host} has no programs; the hosts are {', '.join(hosts)}")
    here = []
    for name in names:
        section = dict(manifest[f"program:{name}"])
        manifest.remove_section(f"program:{name}")
        for each in hosts if name == SENTINEL else [_host(section)]:
            own = sentinel(each) if name == SENTINEL else name
            renamed = f" -r __node:={own}" if name == SENTINEL else ""
            kind = "program:" if each == host else _ELSEWHERE
            manifest[kind + own] = section | {"host": each, "command": section["command"] + renamed}
            here += [own] if each == host else []
    return here


def _host(section: Mapping[str, str]) -> str:
    return section.get("host", ROBOT)


def _add(manifest: configparser.RawConfigParser, path: Path) -> list[str]:
    """Add the programs of a user's file, and return their names."""
    folder = str(path.resolve().parent)
    sys.path.append(folder)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (os.environ.get("PYTHONPATH"), folder)))
    own = _read_own(path)
    ours = set(_names(_read(PATH)))
    for section in own.sections():
        kind, _, name = section.partition(":")
        if problem := _problem(kind, name, own[section].get("command", ""), ours):
            raise DeploymentError(f"{path}: [{section}] {problem}")
        manifest[section] = _settings(own[section], path)
        # A program may work in a directory of its own. supervisord fills in each other %.
        parameters = shlex.quote(str(processes.run_directory() / PARAMETERS)).replace("%", "%%")
        manifest[section]["command"] += f" {_ARGUMENTS.format(name=name, parameters=parameters)}"
    return [section.partition(":")[2] for section in own.sections()]


def _settings(section: configparser.SectionProxy, path: Path) -> dict[str, str]:
    """Return the settings of a program, in which paths count from the folder of the user's file."""
    folder = str(path.resolve().parent).replace("%", "%%")
    settings = {key: value.replace("%(here)s", folder) for key, value in section.items()}
    directory = settings.get("directory", "")
    if directory and "%(" not in directory:  # supervisord fills that in
        settings["directory"] = directory = os.path.join(folder, os.path.expanduser(directory))
        if not os.path.isdir(plain := directory.replace("%%", "%")):
            raise DeploymentError(f"{path}: [{section.name}] directory: there is no folder {plain}")
    return settings


def _read_own(path: Path) -> configparser.RawConfigParser:
    try:
        with path.open(encoding="utf-8-sig") as file:  # some editors begin with a byte order mark
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
        module = _program(name, {"command": command}).module
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


def _program(name: str, section: Mapping[str, str]) -> Program:
    words = shlex.split(section["command"])
    if "--ros-args" in words:
        words = words[: words.index("--ros-args")]
    module = words.index("-m") + 1
    starts = section.get("autostart", "true").lower() in ("true", "yes", "on", "1")
    return Program(name, words[module], tuple(words[module + 1 :]), _host(section), starts)
