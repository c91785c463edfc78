"""What supervisord.conf promises for every program."""

from __future__ import annotations

import configparser
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CONF = configparser.RawConfigParser(inline_comment_prefixes=(" ;",))
CONF.read(ROOT / "deploy" / "supervisord.conf")
SECTIONS = [name for name in CONF.sections() if name.startswith("program:")]
PROGRAMS = {name.removeprefix("program:"): CONF[name] for name in SECTIONS}


def test_all_programs_stop_at_the_same_time_as_one_group() -> None:
    assert set(CONF["group:arm"]["programs"].split(", ")) == PROGRAMS.keys()


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_is_a_module_and_no_shell_stands_before_it(name: str) -> None:
    python, option, module, *_ = shlex.split(PROGRAMS[name]["command"])
    assert (python, option) == ("python", "-m")
    assert (ROOT / module.replace(".", "/")).with_suffix(".py").is_file()
    assert name.startswith("config_") or module.endswith(f".{name}")


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_is_kept_alive_its_log_small_and_its_end_quick(name: str) -> None:
    program = dict(PROGRAMS[name])
    program.pop("command")
    assert program.pop("stdout_logfile") == f"logs/{name}.log"
    assert program == {
        "redirect_stderr": "true",
        "stdout_logfile_maxbytes": "1MB",
        "stdout_logfile_backups": "2",
        "autorestart": "true",
        "startsecs": "1",
        "startretries": "100",
        "stopwaitsecs": "1",
        "killasgroup": "true",
    }


def test_supervisord_listens_on_a_unix_socket_of_its_user_and_nowhere_else() -> None:
    assert CONF["unix_http_server"]["chmod"] == "0700"
    assert "inet_http_server" not in CONF
