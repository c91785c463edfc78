"""`make record`: the messages of a running arm in a file."""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
import time
from contextlib import closing
from pathlib import Path
from random import Random
from typing import Any

import pytest
from mcap_files import McapFile
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from std_msgs.msg import String

from deploy.supervision.processes import ROOT
from interfaces import topics
from tests.system.records import engine_states
from tests.system.sites import LIMIT, Command, Peer, Site

TYPES = {
    topic.name if topic.name.startswith("/") else f"/arm1/{topic.name}": topic.type_name
    for topic in topics.CONTRACT
}
OF_OPERATOR = ("operator_activity", "operator_presence", "operator_heartbeat", "operator_hand")
EVENTS = {f"/arm1/{name}" for name in ("engines", "engines/sender", *OF_OPERATOR)}
"""Topics that may stay silent while the record lasts."""
LATCHED = {f"/arm1/{topic.name}" for topic in topics.CONTRACT if topics.is_latched(topic.qos)}
SUMMARY = r"(/.*\.mcap): ([\d.]+) s, (\d+) messages, ([\d.]+) MB"


def record(site: Site) -> Command:
    command = site.begin("record")
    command.await_line(r"Recording to /.*\.mcap until Ctrl-C")
    return command


def durability(connection: Any) -> str:
    name: str = connection.ext.offered_qos_profiles[0].durability.name
    return name


def test_ctrl_c_completes_a_record_of_all_topics_in_the_namespace(site: Site) -> None:
    site.namespace = "/arm1"
    assert site.do("start", "demo")[0] == 0
    deadline, seconds, seen = time.monotonic() + 2 * LIMIT, 1.0, set[str]()
    while not seen >= TYPES.keys() - EVENTS:  # discovery takes its time
        assert time.monotonic() < deadline, TYPES.keys() - EVENTS - seen
        command = record(site)
        time.sleep(seconds)
        seconds *= 2
        command.signal(signal.SIGINT)
        assert command.wait() == 0
        path, shown_seconds, count, size = command.await_line(SUMMARY).groups()
        with AnyReader([Path(path)], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            messages = [(it.topic, reader.deserialize(data, it.msgtype)) for it, _, data in reader.messages()]
            assert {it.topic: it.msgtype for it in reader.connections}.items() <= TYPES.items()
            latched = {it.topic for it in reader.connections if durability(it) == "TRANSIENT_LOCAL"}
            assert latched <= LATCHED
        seen = {topic for topic, _ in messages}

    assert latched == LATCHED
    assert Path(path).parent == site.run / "records"
    assert len(messages) == int(count)
    assert float(shown_seconds) >= seconds / 2
    assert float(size) == round(Path(path).stat().st_size / 1e6, 2)
    if topics.TF in topics.CONTRACT:
        frames = {it.child_frame_id for topic, tf in messages if topic == "/tf" for it in tf.transforms}
        assert frames == {"arm1/link1", "arm1/link2", "arm1/effector"}
    (description,) = {message.data for topic, message in messages if topic == "/arm1/robot_description"}
    assert re.search(r'<link name="arm1/base">', description)


@pytest.mark.timed
def test_killed_recorder_loses_at_most_a_second(small_site: Site) -> None:
    assert small_site.do("start", "demo")[0] == 0
    random = Random(7)
    for _ in range(3):
        command = record(small_site)
        time.sleep(random.uniform(2.0, 3.0))  # any moment between two writes is a good one
        killed = time.time_ns()
        command.signal(signal.SIGKILL)
        command.wait()
        path = max((small_site.run / "records").iterdir())
        with McapFile(path) as file:
            assert not file.is_complete
            assert killed - file.end < 10**9


def test_full_disk_ends_a_record_in_one_line(small_site: Site) -> None:
    """A limit of the size of a file takes the place of the disk's."""
    assert small_site.do("start", "demo")[0] == 0
    command = record(small_site)
    resource.prlimit(command.pid, resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))
    assert command.wait() == 1
    (path,) = (small_site.run / "records").iterdir()
    reason = r"File too large, [\d.]+ MB are free\. What was written before can be read"
    assert re.fullmatch(rf"{path}: {reason}", command.lines[-1][1])
    assert len(command.lines) == 2
    with McapFile(path) as file:
        assert file.counts.total() > 0


def test_record_is_complete_when_the_system_ends(small_site: Site) -> None:
    assert small_site.do("start", "demo")[0] == 0
    command = record(small_site)
    assert small_site.do("stop")[0] == 0
    assert command.wait() == 0
    command.await_line("The system has ended")
    path = Path(command.await_line(SUMMARY)[1])
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        assert reader.message_count == int(command.await_line(SUMMARY)[3])


def test_record_reports_that_supervisord_has_died(small_site: Site) -> None:
    assert small_site.do("start", "demo")[0] == 0
    command = record(small_site)
    os.kill(small_site.members[""], signal.SIGKILL)
    assert command.wait() == 0
    died = f"supervisord has died; {len(small_site.programs)} services go on without it in {small_site.run}."
    assert died in command.output
    command.await_line(SUMMARY)

    code, printed = small_site.do("record")
    assert (code, printed.splitlines()[0]) == (1, died)
    assert len(list((small_site.run / "records").iterdir())) == 1


def test_ring_keeps_what_surrounds_a_stop(site: Site) -> None:
    assert site.do("start", "demo")[0] == 0
    command = site.begin("record", "1")
    records = Path(command.await_line(r"Recording to (/.*)/ring until Ctrl-C")[1])
    with closing(Peer(site.domain)) as peer:
        commands = peer.publisher(topics.ENGINES)
        peer.spin_until(
            lambda: any(engine_states(path).count(topics.ON) >= 5 for path in records.glob("ring/*"))
        )
        commands.publish(String(data=topics.TURN_OFF))
        peer.spin_until(lambda: list(records.glob("stop-*")))
    command.signal(signal.SIGINT)
    assert command.wait() == 0
    command.await_line(r"/.*/ring: [\d.]+ s, \d+ messages, [\d.]+ MB")
    (stop,) = records.glob("stop-*")
    assert set(engine_states(stop)) == {topics.ON, topics.OFF}


@pytest.mark.parametrize("minutes", ["0", "-1", "ten", "1441", "1.5"])
def test_ring_of_no_number_of_minutes_is_refused(minutes: str) -> None:
    outside = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    make = ["make", "record", f"LAST={minutes}"]
    done = subprocess.run(make, cwd=ROOT, env=outside, capture_output=True, text=True)
    assert done.stderr.splitlines()[0] == f"LAST={minutes}: it is a number of minutes, from 1 to 1440"


def test_record_of_nothing_is_refused(site: Site) -> None:
    assert site.do("record") == (1, "Nothing runs: make start")


@pytest.mark.timed
def test_record_of_a_real_arm_replays_equal_in_virtual_time(site: Site) -> None:
    """What simulation and replay show holds for the rclpy of the real arm: both give the same output."""
    assert site.do("start", "demo")[0] == 0
    command = record(site)
    time.sleep(15.0)  # the engines have been turned on, and the arm has moved
    command.signal(signal.SIGINT)
    assert command.wait() == 0
    path = command.await_line(SUMMARY)[1]
    assert site.do("stop")[0] == 0
    replay = ("-m", "tests.replay", path)
    code, shown = site.do_command("env", "RUNTIME=", str(ROOT / "deploy/commands/venv.sh"), *replay)
    assert code == 0, shown
