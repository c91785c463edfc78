"""An arm whose unit a real systemd starts: a user's service manager in a mount namespace of its own."""

from __future__ import annotations

import os
import shutil
import signal
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.system.sites import LIMIT, LOOK, STEADY, Command, Site

MANAGER = "/usr/lib/systemd/systemd"
CGROUPS = Path("/sys/fs/cgroup")
BOOTED = """
mount -t tmpfs tmpfs /run && mkdir -p /run/systemd/system || exit
group=$1; shift
for each in /sys/fs/cgroup /sys/fs/cgroup/systemd /sys/fs/cgroup/unified; do
    test ! -e $each/cgroup.procs || { mkdir $each/$group && echo $$ > $each/$group/cgroup.procs; } || exit
done
grep -E "^0:|name=systemd" /proc/self/cgroup | grep -v $group && exit
exec "$@"
"""
"""Runs a command in a control group of its own, and where a directory says that systemd has booted.

In the group of the tests, systemd would move all of its processes into another one.
"""
TARGETS = ("basic", "default", "exit", "shutdown")


class Systemd:
    """A systemd of a user who has no other units, and its `systemctl`."""

    def __init__(self, site: Site, folder: Path) -> None:
        self._site = site
        units = folder / "units"
        for each in (units, folder / "run", folder / "home"):
            each.mkdir(mode=0o700)
        for each in TARGETS:
            (units / f"{each}.target").write_text("[Unit]\nDefaultDependencies=no\n")
        self._environment = {
            "PATH": os.environ["PATH"],
            "HOME": str(folder / "home"),
            "XDG_CONFIG_HOME": str(folder / "config"),
            "XDG_RUNTIME_DIR": str(folder / "run"),
            "SYSTEMD_UNIT_PATH": f"{folder}/config/systemd/user:{units}",
            "SYSTEMD_LOG_TARGET": "console",
            "REACTIVE_ARM_TESTS": os.environ["REACTIVE_ARM_TESTS"],
        }
        self._group = f"reactive-arm-{uuid.uuid4()}"
        booted = ["unshare", "--mount", "sh", "-c", BOOTED, "sh", self._group]
        self.command: Command = site.begin_alone([*booted, MANAGER, "--user"], self._environment)

    def do(self, *arguments: str) -> tuple[int, str]:
        variables = [f"{name}={value}" for name, value in self._environment.items()]
        return self._site.do_command("env", *variables, "systemctl", "--user", *arguments)

    def answers(self) -> bool:
        """Wait until it answers; return whether it does before it ends."""
        deadline = time.monotonic() + LIMIT
        while self.do("show-environment")[0]:
            if not self.command.is_alive or time.monotonic() > deadline:
                return False
            time.sleep(LOOK)
        return True

    def close(self) -> None:
        """End it, and remove its control groups, which outlive it."""
        self.do("stop", "reactive-arm")
        self.do("exit", "--force")
        self.command.close()
        for hierarchy in (CGROUPS, *CGROUPS.iterdir()):
            for folder, *_ in os.walk(hierarchy / self._group, topdown=False):
                os.rmdir(folder)

    def main_pid(self) -> int:
        return int(self.do("show", "--value", "--property=MainPID", "reactive-arm")[1])


@pytest.fixture
def systemd(small_site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Systemd]:
    if not Path(MANAGER).exists() or not shutil.which("systemctl"):
        pytest.skip("platform: no systemd")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    code, printed = small_site.do("unit", STEADY)
    assert code == 0, printed
    systemd = Systemd(small_site, tmp_path)
    if not systemd.answers():
        systemd.close()
        pytest.skip(f"platform: no systemd of a user: {systemd.command.output}")
    yield systemd
    systemd.close()


def test_systemd_starts_the_unit_restarts_it_when_killed_and_stops_it(
    small_site: Site, systemd: Systemd
) -> None:
    assert systemd.do("enable", "--now", "reactive-arm")[0] == 0, systemd.command.output
    before = small_site.members  # systemctl returns when all services are up
    assert before.keys() == {"", *small_site.programs}
    assert before[""] == systemd.main_pid()
    assert systemd.do("is-enabled", "reactive-arm") == (0, "enabled")  # at each boot

    os.kill(before[""], signal.SIGKILL)
    small_site.await_members(lambda now: now.keys() == before.keys() and now[""] != before[""])
    assert set(small_site.members.values()).isdisjoint(before.values())
    assert systemd.do("start", "reactive-arm")[0] == 0  # returns when it has started again
    assert systemd.do("is-active", "reactive-arm") == (0, "active")
    assert systemd.do("show", "--value", "--property=NRestarts", "reactive-arm") == (0, "1")

    assert systemd.do("stop", "reactive-arm") == (0, "")
    assert small_site.members == {}
    assert systemd.do("is-failed", "reactive-arm") == (1, "inactive")
