"""The supervised programs, as ``deploy/supervisord.conf`` lists them."""

from __future__ import annotations

import configparser
import shlex
from functools import cache
from pathlib import Path
from typing import NamedTuple

PATH = Path(__file__).resolve().parents[1] / "supervisord.conf"
GROUP = "arm"
"""The supervisor group of all programs."""
SENTINEL = "sentinel"
"""The program that supervises the others together with supervisord."""
PAGE = "operator_page"
"""The program that serves the operator's page."""


class Program(NamedTuple):
    name: str
    """Also the name of its node."""
    module: str
    """The Python module that the program runs."""
    arguments: tuple[str, ...]
    """The arguments before ``--ros-args``."""


def programs(path: Path = PATH) -> tuple[Program, ...]:
    """Return the programs in the order of the group."""
    manifest = _read(path)
    names = manifest[f"group:{GROUP}"]["programs"].replace(",", " ").split()
    return tuple(_program(name, manifest[f"program:{name}"]["command"]) for name in names)


@cache
def start_retries(program: str) -> int:
    """Return after how many early ends supervisord gives a program up."""
    return _read(PATH).getint(f"program:{program}", "startretries")


def _read(path: Path) -> configparser.RawConfigParser:
    manifest = configparser.RawConfigParser(inline_comment_prefixes=(" ;",))
    manifest.read(path, encoding="utf-8")
    return manifest


def _program(name: str, command: str) -> Program:
    words = shlex.split(command)
    words = words[: words.index("--ros-args")]
    module = words.index("-m") + 1
    return Program(name, words[module], tuple(words[module + 1 :]))
