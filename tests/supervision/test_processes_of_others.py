"""What another user of the machine starts is no part of our system, whatever its environment says."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE, Popen

import pytest

from deploy.supervision import processes, rpc
from tests.users import NOBODY, needs_root, process_of_nobody, public_folder

pytestmark = needs_root
WAITING = ("sh", "-c", "echo; exec sleep 60")
RAISED = "$< = 0; $> = 0; $| = 1; print qq(\\n); sleep 60"
"""A set-user-ID program that becomes root, as sudo does before it asks for a password."""


def marked(run: Path) -> dict[str, str]:
    return {processes.MARK: str(run), "PATH": f"/evil:{os.environ['PATH']}"}


@contextmanager
def raised(run: Path) -> Iterator[Popen[str]]:
    """Let another user start a program that runs as root."""
    if (perl := shutil.which("perl")) is None:
        pytest.skip("platform: there is no perl")
    with public_folder() as folder:
        copy, script = folder / "perl", folder / "script.pl"
        shutil.copy(perl, copy)
        copy.chmod(0o755 | stat.S_ISUID)
        script.write_text(RAISED)
        with process_of_nobody(copy, script, **marked(run)) as process:
            yield process


@pytest.mark.parametrize("program", ["own", "raised"])
def test_process_of_another_user_is_no_member(tmp_path: Path, program: str) -> None:
    with raised(tmp_path) if program == "raised" else process_of_nobody(*WAITING, **marked(tmp_path)) as it:
        assert processes.of_system(tmp_path) == []
        assert tmp_path not in processes.systems()
        assert tmp_path not in processes.using(Path("/evil"))
        assert processes.environment_of(it.pid) == {}


def test_process_of_another_user_is_not_ended(tmp_path: Path) -> None:
    with process_of_nobody(*WAITING, **marked(tmp_path), SUPERVISOR_PROCESS_NAME="velocity") as stranger:
        processes.end(tmp_path, [stranger.pid], 0.0)
        assert not processes.send_signal(tmp_path, "velocity", stranger.pid, signal.SIGKILL)
        assert stranger.poll() is None


def test_process_of_a_container_is_no_member(tmp_path: Path) -> None:
    command = ["unshare", "--pid", "--fork", "--kill-child", *WAITING]
    with Popen(command, env=os.environ | marked(tmp_path), stdout=PIPE) as outside:
        assert outside.stdout is not None
        outside.stdout.readline()
        assert [each.pid for each in processes.of_system(tmp_path)] == [outside.pid]
        outside.kill()


def test_supervisord_of_another_user_is_not_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("supervisor.sock")
        monkeypatch.setattr(os, "geteuid", lambda: NOBODY)
        server.listen()
        with pytest.raises(rpc.NoAnswer, match=r"it belongs to another user$"):
            rpc.call(os.getpid(), "supervisor.getState")
