"""Another user of the machine, beside an arm without keys."""

from __future__ import annotations

import os
import signal
import socket
import time
from contextlib import suppress

from deploy.supervision import processes
from interfaces.service.unix_sockets import owners
from tests.system.sites import LIMIT, SMALL, Site
from tests.users import NOBODY, fork, needs_root, process_of_nobody, public_folder

SERVICE = "engine_controller"
EVIL = "import os; os.write(2, b'code of another user')"


def bind(names: set[str]) -> list[socket.socket]:
    """Bind those abstract addresses that are free."""
    bound = []
    for name in names:
        with suppress(OSError):
            bound.append(socket.socket(socket.AF_UNIX))
            bound[-1].bind(f"\0{name}")
    return bound


@needs_root
def test_killed_service_is_back_although_another_user_has_its_names(small_site: Site) -> None:
    assert small_site.do("start", "none")[0] == 0
    prefix = f"reactive-arm/{small_site.domain}/"
    held = {*owners(prefix)}
    assert len(held) == len(SMALL)
    killed = small_site.members[SERVICE]
    os.kill(small_site.members[""], signal.SIGSTOP)  # supervisord starts no successor yet
    os.kill(killed, signal.SIGKILL)
    while len(owners(prefix)) == len(SMALL):
        time.sleep(0.01)
    later = {f"{name.rpartition('/')[0]}/{number}" for name in held for number in range(1, 3)}
    with fork(lambda: bind(held | later), user=NOBODY):
        assert [*owners(prefix).values()].count(NOBODY) == 1 + 2 * len(SMALL)
        os.kill(small_site.members[""], signal.SIGCONT)
        deadline = time.monotonic() + LIMIT
        while [*owners(prefix).values()].count(0) < len(SMALL):
            assert time.monotonic() < deadline, small_site.do("status")
            time.sleep(0.1)
        assert small_site.members.keys() == {"", *SMALL}


@needs_root
def test_start_names_the_other_user_of_a_domain(small_site: Site) -> None:
    assert small_site.do("start", "none")[0] == 0
    held = {*owners(f"reactive-arm/{small_site.domain}/")}
    small_site.do("stop")
    with fork(lambda: bind(held), user=NOBODY):
        code, words = small_site.do("start", "none")
    assert code == 1
    assert f"ROS domain {small_site.domain} is in use" in words
    assert "already runs on this host, started by nobody. Set ROS_DOMAIN_ID" in words


def test_umask_of_the_shell_opens_nothing_to_others(small_site: Site) -> None:
    small_site.run.mkdir(0o755)
    mask = os.umask(0)
    try:
        assert small_site.do("start", "none")[0] == 0
        assert small_site.do("stop")[0] == 0
    finally:
        os.umask(mask)
    assert not [path for path in small_site.run.rglob("*") if path.stat().st_mode & 0o077]


@needs_root
def test_another_user_chooses_no_environment_of_a_command(small_site: Site) -> None:
    small_site.run.mkdir(0o700)
    with public_folder() as folder:
        (folder / "sitecustomize.py").write_text(EVIL)
        marked = {processes.MARK: str(small_site.run), "PYTHONPATH": str(folder)}
        with process_of_nobody("sh", "-c", "echo; exec sleep 60", **marked):
            assert small_site.do("status") == (0, "Nothing runs.")
            assert small_site.do("start", "none")[0] == 0
