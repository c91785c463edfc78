from __future__ import annotations

import configparser
import shlex

import pytest

from deploy.supervision import manifest
from deploy.supervision.processes import ROOT

CONF = configparser.RawConfigParser(inline_comment_prefixes=(" ;",))
CONF.read(manifest.PATH)
SECTIONS = {
    section.removeprefix("program:"): CONF[section]
    for section in CONF.sections()
    if section.startswith("program:")
}


def test_all_programs_stop_at_the_same_time_as_one_group() -> None:
    assert {program.name for program in manifest.programs()} == SECTIONS.keys()


def test_a_program_has_its_module_and_arguments() -> None:
    first, *_, last = manifest.programs()
    assert first == manifest.Program("config_l1", "services.config_publisher", ("l1",))
    assert last == manifest.Program("sentinel", "deploy.supervision.sentinel", ())


@pytest.mark.parametrize("name", SECTIONS)
def test_a_program_is_a_module_and_no_shell_stands_before_it(name: str) -> None:
    python, option, module, *_ = shlex.split(SECTIONS[name]["command"])
    assert (python, option) == ("python3", "-m")
    assert (ROOT / module.replace(".", "/")).with_suffix(".py").is_file()
    assert name.startswith("config_") or module.endswith(f".{name}")


@pytest.mark.parametrize("name", SECTIONS)
def test_a_program_restarts_ends_quickly_and_has_a_small_log(name: str) -> None:
    settings = dict(SECTIONS[name])
    settings.pop("command")
    assert settings.pop("host", "operator") == "operator"
    assert settings == {
        "redirect_stderr": "true",
        "stdout_logfile": "logs/%(program_name)s.log",
        "stdout_logfile_maxbytes": "1MB",
        "stdout_logfile_backups": "2",
        "autorestart": "true",
        "startretries": "100",
        "stopwaitsecs": "1",
        "killasgroup": "true",
    }


def test_supervisord_listens_on_a_unix_socket_of_its_user_only() -> None:
    assert CONF["unix_http_server"]["chmod"] == "0700"
    assert "inet_http_server" not in CONF
