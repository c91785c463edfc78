from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.supervision.processes import ROOT

WAITS = """
import time
from deploy.supervision import interruption
interruption.install()
print("ready", flush=True)
try:
    while True:
        interruption.check()
        time.sleep(0.01)
except interruption.Interrupted:
    print("done", flush=True)
"""
CONTAINER = ("unshare", "--map-root-user", "--pid", "--mount-proc", "--fork", "--kill-child")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_make_as_the_first_process_of_a_container_ends_by_a_signal(
    number: signal.Signals, tmp_path: Path
) -> None:
    (tmp_path / "waits.py").write_text(WAITS)
    (tmp_path / "Makefile").write_text(f"run:\n\t@exec {sys.executable} waits.py\n")
    with subprocess.Popen(
        [*CONTAINER, "make"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as container:
        assert container.stdout is not None
        assert container.stderr is not None
        try:
            if container.stdout.readline() != "ready\n":
                pytest.skip(f"platform: {container.stderr.read()}")
            children = Path(f"/proc/{container.pid}/task/{container.pid}/children")
            os.kill(int(children.read_text()), number)
            assert container.communicate(timeout=60.0)[0] == "done\n"
        finally:
            container.kill()
