"""`make record`: writes the messages of a running arm to a file until Ctrl-C."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from deploy.commands.member import Member
from deploy.recording.recorder import Recorder, record
from deploy.supervision import interruption


def write(directory: Path, member: Member, has_ended: Callable[[], bool]) -> None:
    """Record until Ctrl-C or until the system has ended; print the path, duration and size of the file."""
    directory.mkdir(exist_ok=True)
    path = directory / time.strftime("%Y%m%d-%H%M%S.mcap")
    began = time.monotonic()
    with closing(Recorder(path, time.monotonic_ns(), time.time_ns())) as recorder:
        record(member.node, recorder)
        print(f"Recording to {path} until Ctrl-C ...", flush=True)
        try:
            while not has_ended():
                member.spin_once()
            print("The system has ended.")
        except interruption.Interrupted:
            interruption.ignore()
    seconds, size = time.monotonic() - began, path.stat().st_size / 1e6
    print(f"{path}: {seconds:.1f} s, {recorder.count} messages, {size:.2f} MB")
