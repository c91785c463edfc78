"""`make record`: writes the messages of a running arm to a file until Ctrl-C."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path

from mcap_files import SAVE_PERIOD
from rclpy.clock import Clock, ClockType

from deploy.commands.member import Member
from deploy.supervision import interruption, messages
from deploy.supervision.errors import DeploymentError
from deploy.supervision.recorder import Recorder, clocks, record
from deploy.supervision.system import System


def write(directory: Path, member: Member, system: System) -> None:
    """Record until Ctrl-C or until supervisord has ended; print the path, duration and size of the file."""
    directory.mkdir(exist_ok=True)
    path = directory / time.strftime("%Y%m%d-%H%M%S.mcap")
    began = time.monotonic()
    try:
        with closing(Recorder(path, *clocks())) as recorder:
            record(member.node, recorder)
            clock = Clock(clock_type=ClockType.STEADY_TIME)
            member.node.create_timer(SAVE_PERIOD, recorder.save, clock=clock)
            print(f"Recording to {path} until Ctrl-C ...", flush=True)
            try:
                while not system.supervisor_has_ended():
                    member.spin_once()
                print(messages.how_it_ended(system.run))
            except interruption.Interrupted:
                interruption.ignore()
    except OSError as error:  # such as a full disk
        raise DeploymentError(f"{path}: {error.strerror}") from None
    seconds, size = time.monotonic() - began, path.stat().st_size / 1e6
    print(f"{path}: {seconds:.1f} s, {recorder.count} messages, {size:.2f} MB")
