"""`make record`: writes the messages of a running arm to a file, or keeps only the last minutes of them."""

from __future__ import annotations

import os
import time
from collections.abc import Collection
from contextlib import closing
from pathlib import Path

from mcap_files import SAVE_PERIOD
from rclpy.clock import Clock, ClockType

from deploy.commands.member import Member
from deploy.supervision import interruption, manifest, messages
from deploy.supervision.environment import SECURITY
from deploy.supervision.errors import DeploymentError
from deploy.supervision.recorder import Recorder, clocks, record, record_others
from deploy.supervision.ring import RING, Ring
from deploy.supervision.run_directory import STOP_RECORD
from deploy.supervision.system import System
from interfaces import topics
from interfaces.service.reading import observe, unreported
from reactive_node import ReactiveNode


def write(directory: Path, member: Member, system: System, minutes: int) -> None:
    """Record until Ctrl-C or until supervisord has ended; print the path, duration and size of the files.

    :param minutes: how many of the last ones are kept, with what surrounds a stop; 0 keeps all in one file.
    """
    directory.mkdir(exist_ok=True)
    path = directory / (RING if minutes else time.strftime("%Y%m%d-%H%M%S.mcap"))
    began = time.monotonic()
    try:
        node = member.node
        with closing(_ring(directory, node, minutes) if minutes else Recorder(path, *clocks())) as recorder:
            record(node, recorder)
            if os.environ.get(SECURITY) != "true":  # keys are for the contract
                record_others(node, recorder, manifest.own())
            clock = Clock(clock_type=ClockType.STEADY_TIME)
            node.create_timer(SAVE_PERIOD, recorder.save, clock=clock)
            print(f"Recording to {path} until Ctrl-C ...", flush=True)
            if minutes:
                stops = f"{directory}/{STOP_RECORD}*"
                print(f"The last {minutes} min stay there, and what surrounds a stop in {stops}", flush=True)
            try:
                while not system.supervisor_has_ended():
                    member.spin_once()
                print(messages.how_it_ended(system.run))
            except interruption.Interrupted:
                interruption.ignore()
    except OSError as error:  # such as a full disk
        raise DeploymentError(f"{error.filename or path}: {error.strerror}") from None
    seconds = time.monotonic() - began
    paths: Collection[Path] = [*path.iterdir(), *directory.glob(f"{STOP_RECORD}*")] if minutes else [path]
    size = sum(each.stat().st_size for each in paths) / 1e6
    print(f"{path}: {seconds:.1f} s, {recorder.count} messages, {size:.2f} MB")


def _ring(directory: Path, node: ReactiveNode, minutes: int) -> Ring:
    """Return a ring that notes each stop of the engines, for as long as the node is spun."""
    latched = {node.resolve_topic_name(it.name) for it in topics.CONTRACT if topics.is_latched(it.qos)}
    ring = Ring(directory, minutes, latched, *clocks())
    states = observe(node, topics.ENGINES_STATE, unreported)
    stops = states.pairwise().filter(lambda it: it == (topics.ON, topics.OFF))
    stops.subscribe(lambda _: ring.stop(time.monotonic_ns()))
    return ring
