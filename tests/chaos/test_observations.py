from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from std_msgs.msg import Bool, Float64, String

from deploy.supervision import processes
from deploy.supervision.recorder import Recorder, qos_profiles
from interfaces import topics
from tests.chaos import __main__ as chaos
from tests.promises.history import NO_TARGET, OVERLOAD, Condition, InjectedFault, Life
from tests.promises.marks import STEP
from tests.promises.observations import FAULTS, PROCESSES, load, values


def recorded(
    path: Path,
    *events: Life | InjectedFault | Condition,
    seconds: int = 20,
    late: Callable[[int], float] = lambda second: 0.002,
    ahead: Callable[[int], float] = lambda second: 0.0,
) -> bytes:
    """Write a record with events, and a speed at each second; return its bytes.

    :param late: returns how long the message of a second takes [s].
    :param ahead: returns by how much its stamp is ahead [s].
    """
    recorder = Recorder(path, 0, 10**18)
    for event in events:
        topic = PROCESSES if isinstance(event, Life) else FAULTS
        recorder.event(topic, 1, event._asdict() | {"namespace": "/"})
    speed, data = topics.EFFECTOR_SPEED, serialize_message(Float64(data=1.5))
    for second in range(seconds):
        received, stamp = (round((second + more(second)) * 1e9) for more in (late, ahead))
        recorder.message("/effector/speed", speed.type_name, qos_profiles(speed), data, received, stamp)
    recorder.close()
    return path.read_bytes()


class Judged(NamedTuple):
    code: int
    output: str
    errors: str


Judge = Callable[[Path], Judged]


@pytest.fixture
def judge(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Judge:
    """Judges a record as the command does, in the process of the test."""
    monkeypatch.setattr(chaos.interruption, "install", lambda: None)
    monkeypatch.setattr(chaos, "set_middleware", lambda environment: None)
    return lambda record: Judged(chaos.main(["--replay", str(record)]), *capsys.readouterr())


EVENT = '{{"namespace": "/", "program": "x", "pid": {pid}, "began": {began}, "ended": null}}'


@pytest.mark.parametrize(
    "event",
    [
        *("", "[]", "{}", '{"namespace": "/", "x": 1}', "[" * 100_000, "9" * 9_999),
        EVENT.format(pid='"<script>"', began=0),
        EVENT.format(pid=7, began='"0"'),
        EVENT.format(pid=7, began="null"),
    ],
)
def test_record_of_others_is_refused_in_one_line(event: str, tmp_path: Path, judge: Judge) -> None:
    record = tmp_path / "record.mcap"
    recorder = Recorder(record, 0, 10**18)
    recorder.message(PROCESSES, "std_msgs/msg/String", "", serialize_message(String(data=event)), 0, 0)
    recorder.close()
    code, _, errors = judge(record)
    assert code == 1
    assert re.fullmatch(f"Record {record}: it is none of make chaos: .*\n", errors)


@pytest.mark.parametrize("pid", ["none", "", "1" * 5000])
def test_health_without_a_pid_says_nothing_about_processes(pid: str) -> None:
    foreign = DiagnosticStatus(name="/camera", values=[KeyValue(key="pid", value=pid)])
    own = DiagnosticStatus(name="/velocity", values=[KeyValue(key="pid", value="7")])
    data = serialize_message(DiagnosticArray(status=[foreign, own]))
    assert values(topics.DIAGNOSTICS, data, "/") == [("velocity", 7)]


@pytest.mark.parametrize(
    ("options", "code", "reason"),
    [
        ("--minutes 0.1", 1, "No fault is planned: the time is too short"),
        ("--arms 73", 2, "--arms must be from 1 to 72: each arm needs a ROS domain"),
        ("--scenario partition --arms 2", 2, "--scenario partition allows only one arm"),
    ],
)
def test_impossible_options_are_refused(tmp_path: Path, options: str, code: int, reason: str) -> None:
    command = [sys.executable, "-m", "tests.chaos", *options.split()]
    environment = {**os.environ, "REACTIVE_ARM_RUN_DIR": str(tmp_path)}
    end = subprocess.run(
        command, cwd=processes.ROOT, env=environment, capture_output=True, text=True, timeout=60
    )
    assert end.returncode == code
    assert end.stderr.splitlines()[-1].endswith(reason)
    assert not list(tmp_path.glob("chaos/*"))


def test_ctrl_c_ends_the_judgement(tmp_path: Path) -> None:
    path = tmp_path / "record.mcap"
    recorded(path, ONE)
    script = (
        "import os, signal, sys; signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT});"
        "os.kill(os.getpid(), signal.SIGINT);"
        f"import tests.chaos.__main__ as chaos; sys.exit(chaos.main(['--replay', {str(path)!r}]))"
    )
    end = subprocess.run(
        [sys.executable, "-c", script], cwd=processes.ROOT, capture_output=True, text=True, timeout=60
    )
    assert (end.returncode, end.stdout) == (130, "Interrupted: all processes have been stopped.\n")


ONE = Life("velocity", 7, 0.0, None)


def test_ros_tools_read_a_record(tmp_path: Path) -> None:
    path = tmp_path / "record.mcap"
    recorded(path, ONE)
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        read = [
            (connection.topic, time, reader.deserialize(data, connection.msgtype).data)
            for connection, time, data in reader.messages()
        ]
    assert read[1:3] == [
        ("/effector/speed", 10**18 + 2_000_000, 1.5),
        ("/effector/speed", 10**18 + 1_002_000_000, 1.5),
    ]
    assert json.loads(read[0][2])["program"] == "velocity"


def test_times_of_a_stepped_arm_are_those_of_the_machine(tmp_path: Path) -> None:
    path = tmp_path / "record.mcap"
    step = InjectedFault(STEP, NO_TARGET, 5.0, 5.0, ahead=-1000.5)
    recorded(path, step, seconds=10, ahead=lambda second: -1000.5 if second > 5 else 0.0)
    speeds = load(path).stream(topics.EFFECTOR_SPEED)
    assert [speed.sent for speed in speeds] == pytest.approx(range(10), abs=1e-6)


def overloads_of(
    path: Path, lateness: float, *events: Life | InjectedFault | Condition
) -> list[tuple[float, float]]:
    """Record a speed each second, the one of second 10 late by ``lateness`` [s]; return the overloads."""
    recorded(path, *events, late=lambda second: lateness if second == 10 else 0.002)
    found = (each for each in load(path).conditions if each.kind == OVERLOAD)
    return [(round(each.begin, 6), round(each.end, 6)) for each in found]


@pytest.mark.parametrize(
    ("lateness", "overloads"), [(0.09, []), (0.11, [(10.0, 10.11)]), (3.0, [(10.0, 13.0)])]
)
def test_late_reception_is_an_overload(
    lateness: float, overloads: list[tuple[float, float]], tmp_path: Path
) -> None:
    assert overloads_of(tmp_path / "record.mcap", lateness) == overloads


@pytest.mark.parametrize(
    ("event", "number"),
    [
        (Life("velocity", 7, 8.1, None), 0),  # the observer may not have known it yet
        (Life("velocity", 7, 7.9, None), 1),
        (Life("kinematics", 7, 9.0, None), 1),
        (InjectedFault("partition", "operator", 5.0, 9.0), 0),
        (InjectedFault("partition", "operator", 10.4, 11.0), 0),  # it was under way
        (InjectedFault("partition", "operator", 10.6, 11.0), 1),
        (InjectedFault("bad_line", "operator", 5.0, 12.0), 0),
        (Condition("loss", 0.0, 30.0), 0),  # --loss
        (Condition("loss", 9.0, 11.0), 1),  # part of the overload
        (InjectedFault("stop", "velocity", 9.0, 11.0), 1),
    ],
)
def test_late_reception_by_discovery_or_network_is_no_overload(
    event: Life | InjectedFault | Condition, number: int, tmp_path: Path
) -> None:
    assert len(overloads_of(tmp_path / "record.mcap", 0.5, event)) == number


def test_observer_that_received_nothing_for_a_while_blames_nobody(tmp_path: Path, judge: Judge) -> None:
    path = tmp_path / "record.mcap"
    recorder = Recorder(path, 0, 10**18)

    def record(topic: topics.Topic, message: Any, sent: float, received: float) -> None:
        name, times = topic.full_name("/"), (int(received * 1e9), int(sent * 1e9))
        recorder.message(name, topic.type_name, "", serialize_message(message), *times)

    recorder.event(PROCESSES, 1, ONE._asdict() | {"namespace": "/"})
    record(topics.ENGINES, String(data=topics.TURN_ON), 0.95, 0.951)
    for step in range(10, 60):
        now = step / 10
        is_deaf = 3.0 <= now < 3.8
        if not is_deaf:  # during it, samples with a lifespan expire
            record(topics.OPERATOR_HEARTBEAT, Bool(data=True), now, now + 0.001)
            record(topics.ENGINES_STATE, String(data=topics.ON), now, now + 0.001)
        record(topics.EFFECTOR_SPEED, Float64(data=1.0), now, 3.8 if is_deaf else now + 0.001)
    recorder.close()
    judged = judge(path)
    assert judged.code == 0
    assert judged.output.startswith(
        "\n1 overload of the machine or the observer, 0.8 s in all; weakened verdicts: S3\n\n"
    )
    (row,) = (line for line in judged.output.splitlines() if line.startswith("S3"))
    assert re.search(r"holds +1 +1 ", row)
    assert "weakened verdicts: S3" in (tmp_path / "replay.html").read_text(encoding="utf-8")


def test_violation_is_reported_with_evidence_and_exit_code_1(tmp_path: Path, judge: Judge) -> None:
    path = tmp_path / "record.mcap"
    recorded(path, Life("", 7, 0.0, None), Life("", 8, 5.0, 12.0))
    judged = judge(path)
    assert judged.code == 1
    assert "S5 is violated:\n  at 5.00 s: processes 7 and 8 are both supervisord" in judged.output
    page = (tmp_path / "replay.html").read_text(encoding="utf-8")
    assert "<h1 class=violated>S5 violated</h1>" in page
    assert "processes 7 and 8 are both supervisord" in page


@pytest.mark.parametrize(
    ("seconds", "code", "verdict"),
    [(20, 0, "No promise is violated, but "), (0, 1, "No promise was exercised")],
)
def test_exit_code_is_0_if_promises_are_known_to_hold(
    seconds: int, code: int, verdict: str, tmp_path: Path, judge: Judge
) -> None:
    path = tmp_path / "record.mcap"
    recorded(path, ONE, seconds=seconds)
    judged = judge(path)
    assert judged.code == code
    assert f"\n{verdict}" in judged.output


@pytest.mark.parametrize(
    ("kept", "reason"), [(0, "is no MCAP file"), (5, "is no MCAP file"), (200, "contains no arm")]
)
def test_beginning_of_a_record_is_refused_in_one_line(
    kept: int, reason: str, tmp_path: Path, judge: Judge
) -> None:
    record = tmp_path / "record.mcap"
    record.write_bytes(recorded(tmp_path / "whole.mcap", ONE)[:kept])
    judged = judge(record)
    assert (judged.code, judged.errors) == (1, f"{record} {reason}\n")


def test_whole_part_of_a_record_without_an_end_is_judged(tmp_path: Path, judge: Judge) -> None:
    record = tmp_path / "record.mcap"
    record.write_bytes(recorded(tmp_path / "whole.mcap", ONE)[:-10])
    judged = judge(record)
    assert judged.code == 0, judged.errors
    assert judged.output.startswith(f"{record} has no end: its 21 whole messages of 19.0 s are read\n")


def test_missing_file_is_refused_in_one_line(tmp_path: Path, judge: Judge) -> None:
    judged = judge(tmp_path / "nix")
    expected = f"Record {tmp_path / 'nix'}: No such file or directory\n"
    assert (judged.code, judged.errors) == (1, expected)
