"""Replay of a real arm's record, made by `ros2 bag record --storage-preset-profile zstd_small`.

In the 38 s of arm.mcap the engines are turned on, the watchdog and kinematics are killed, the operator falls
asleep until the watchdog turns the engines off, comes back, and turns them on again.
"""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TransformStamped, Twist, TwistStamped, Vector3
from mcap_files import FileWriter, McapFile
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64, Header, String

from deploy.supervision.errors import DeploymentError
from deploy.supervision.processes import ROOT
from deploy.supervision.recorder import Recorder
from interfaces import topics
from interfaces.robot_model import BASE, LINK1, frame_id
from tests.promises.history import NO_TARGET, InjectedFault
from tests.promises.marks import STEP
from tests.promises.observations import FAULTS
from tests.replay import chains
from tests.replay.__main__ import newest
from tests.replay.comparison import compare
from tests.replay.record import Message, Record, load

RECORD = Path(__file__).parent / "arm.mcap"
SECOND = 10**9
BY_NAME = {topic.full_name("/"): topic for topic in topics.CONTRACT}


class Received(NamedTuple):
    """A message in a file; times in ns since 1970."""

    log_time: int
    publish_time: int
    data: bytes


def replay(
    record: Path,
    *options: str,
    directory: Path = ROOT,
    **environment: str,
) -> subprocess.CompletedProcess[str]:
    """Replay in a subprocess, which handles signals; modules of the directory come first."""
    return subprocess.run(
        [sys.executable, "-m", "tests.replay", str(record), *options],
        cwd=directory,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
        timeout=150,
    )


def verdicts(done: subprocess.CompletedProcess[str]) -> dict[str, str]:
    rows = re.findall(r"^(\S+) .* (equal|DIFFERENT|unknown) ", done.stdout, re.MULTILINE)
    return dict(rows)


def test_replay_of_a_real_play_is_equal_and_the_same_each_time(tmp_path: Path) -> None:
    outputs = [tmp_path / "one.mcap", tmp_path / "two.mcap"]
    for seed, output in enumerate(outputs):
        done = replay(RECORD, "--output", str(output), PYTHONHASHSEED=str(seed))
        assert (done.returncode, done.stderr) == (0, ""), done.stdout
        assert verdicts(done) == {
            "effector/position": "equal",
            "effector/speed": "equal",
            "operator_presence": "equal",
            "operator_activity": "equal",
            "engines": "equal",
            "engines/state": "equal",
        }
        assert "\nEqual within the bounds for 38 s\n" in done.stdout
    assert outputs[0].read_bytes() == outputs[1].read_bytes()

    states = load(outputs[0]).of(topics.ENGINES_STATE, "/")
    texts = [deserialize_message(message.data, String).data for message in states]
    changes = [text for before, text in zip(["", *texts], texts, strict=False) if text != before]
    assert changes[-3:] == ["on", "off", "on"]


POSITION = (
    "kinematics.py",
    ".starmap(forward_kinematics)",
    ".starmap(forward_kinematics).map(lambda at: (at[0], -at[1]))",
    "effector/position",
)
SPEED = ("velocity.py", "before.y) / seconds", "before.y) / seconds * 1.001", "effector/speed")
ACTIVITY = ("operator_watchdog.py", "parameter(3, (1, 100)", "parameter(2, (1, 100)", "operator_activity")
COMMAND = ("operator_watchdog.py", "lambda _: TURN_OFF", "lambda _: topics.TURN_ON", "engines")
STATE = ("engine_controller.py", "10.0, (1.0, 10.0)", "5.0, (1.0, 10.0)", "engines/state")


@pytest.mark.parametrize(
    "changes",
    [[POSITION, ACTIVITY], [SPEED, COMMAND], [STATE]],
    ids=["position and activity", "speed and command", "state"],
)
def test_changed_recipe_differs(changes: list[tuple[str, str, str, str]], tmp_path: Path) -> None:
    """Changes of one replay are of chains that do not hear each other's replayed output."""
    shutil.copytree(ROOT / "services", tmp_path / "services")
    for file, text, other, _ in changes:
        changed = tmp_path / "services" / file
        source = changed.read_text()
        assert text in source
        changed.write_text(source.replace(text, other))
    done = replay(RECORD, "--output", str(tmp_path / "out.mcap"), directory=tmp_path)
    assert done.returncode == 1, done.stderr
    for *_, topic in changes:
        assert verdicts(done)[topic] == "DIFFERENT"
        assert re.search(rf"^Different in 38 s: .*{topic}", done.stdout, re.MULTILINE)


def test_changed_parameter_differs(tmp_path: Path) -> None:
    parameters = tmp_path / "parameters.yaml"
    parameters.write_text("operator_watchdog: {ros__parameters: {silence: 1.0}}")
    done = replay(RECORD, "--output", str(tmp_path / "out.mcap"), "--parameters", str(parameters))
    assert done.returncode == 1
    assert verdicts(done)["engines/state"] == "DIFFERENT"


def test_service_that_fails_is_reported(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "services", tmp_path / "services")
    (tmp_path / "services" / "velocity.py").write_text("raise ValueError('no velocity')")
    done = replay(RECORD, "--output", str(tmp_path / "out.mcap"), directory=tmp_path)
    assert done.returncode == 1
    assert "velocity ended: ValueError: no velocity" in done.stdout


def damaged(data: bytes) -> bytes:
    return data[:50_000] + bytes(100) + data[50_100:]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda data: b"", "is no MCAP file"),
        (lambda data: b"Dear arm,\n", "is no MCAP file"),
        (damaged, "is damaged: "),
        (lambda data: data[:1000], "contains no topic of an arm"),
    ],
    ids=["empty", "letter", "damaged", "beginning"],
)
def test_bad_file_is_refused_in_one_line(
    change: Callable[[bytes], bytes], reason: str, tmp_path: Path
) -> None:
    record = tmp_path / "record.mcap"
    record.write_bytes(change(RECORD.read_bytes()))
    with pytest.raises(DeploymentError) as error:
        load(record)
    assert str(error.value).startswith(f"{record} {reason}")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "event",
    ["", "x", "[]", "{}", '{"ahead": "late"}', '{"kind": "kill", "end": 1}', "[" * 100_000, "9" * 9_999],
    ids=lambda event: event[:20],
)
def test_events_that_no_chaos_monkey_wrote_are_one_line(event: str, tmp_path: Path) -> None:
    record = tmp_path / "record.mcap"
    recorder = Recorder(record, 0, SECOND)
    recorder.message("/engines/state", "std_msgs/msg/String", "", serialize_message(String(data="on")), 0, 0)
    recorder.message(FAULTS, "std_msgs/msg/String", "", serialize_message(String(data=event)), 0, 0)
    recorder.close()
    with pytest.raises(DeploymentError, match=f"^{record} has events that no chaos monkey wrote: .*$"):
        load(record)


def test_record_of_years_is_refused(tmp_path: Path) -> None:
    record = tmp_path / "record.mcap"
    recorder = Recorder(record, 0, SECOND)
    for time in (0, 2**63):
        state = serialize_message(String(data="on"))
        recorder.message("/engines/state", "std_msgs/msg/String", "", state, time, time)
    recorder.close()
    with pytest.raises(
        DeploymentError, match=f"^{record} lasts 2562047 hours, more than the limit of 100 hours$"
    ):
        load(record)


def derived(
    path: Path,
    change: Callable[[str, Received], Received | None] = lambda topic, received: received,
    *others: tuple[str, int],
) -> Path:
    """:param change: returns what replaces a message; ``None`` for nothing.
    :param others: topics that are not the arm's, and when a message of them was received [ns of the record].
    """
    with McapFile(RECORD) as record:
        writer = FileWriter(path, "test")
        numbers = {
            channel.topic: writer.register_channel(
                channel.topic,
                "cdr",
                writer.register_schema(record.type_name(channel), "ros2msg", b""),
                channel.metadata,
            )
            for channel in record.channels.values()
        }
        for channel, message in record.messages():
            received = Received(message.log_time, message.publish_time, message.data)
            if (changed := change(channel.topic, received)) is not None:
                writer.add_message(
                    numbers[channel.topic], changed.log_time, changed.data, changed.publish_time
                )
        string = writer.register_schema("std_msgs/msg/String", "ros2msg", b"")
        for topic, time in others:
            at = record.start + time
            other = writer.register_channel(topic, "cdr", string)
            writer.add_message(other, at, serialize_message(String(data="x")), at)
        writer.close()
    return path


def late(path: Path, begin: float, end: float = 60.0) -> Path:
    """Write what a recorder receives that begins later and ends earlier [s after the record's begin]."""
    with McapFile(RECORD) as record:
        first, last = (record.start + round(time * SECOND) for time in (begin, end))
        kept = {
            channel.topic: message
            for channel, message in record.messages(end=first - 1)
            if topics.is_latched(BY_NAME[channel.topic].qos)
        }

    def received(topic: str, it: Received) -> Received | None:
        if it.log_time >= first:
            return it if it.log_time <= last else None
        is_retained = topic in kept and kept[topic].log_time == it.log_time
        return it._replace(log_time=first) if is_retained else None

    return derived(path, received)


@pytest.mark.parametrize(
    "extent",
    [(5.0,), (17.0,), (20.5,), (23.0,), (24.9165,), (27.0,), (25.2, 30.4)],
    ids=[
        "engines on",
        "silence",
        "a strike",
        "two strikes",
        "three strikes",
        "incapacitated",
        "until the end",
    ],
)
def test_record_that_begins_with_a_past_is_equal(extent: tuple[float, ...], tmp_path: Path) -> None:
    done = replay(late(tmp_path / "late.mcap", *extent))
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert set(verdicts(done).values()) == {"equal"}


def test_record_of_an_absent_operator_is_compared(tmp_path: Path) -> None:
    done = replay(late(tmp_path / "late.mcap", 17.0, 30.4))
    assert done.returncode == 0, done.stdout
    assert (
        verdicts(done).items()
        >= dict.fromkeys(("operator_activity", "engines", "engines/state"), "equal").items()
    )


def test_record_that_shows_too_little_cannot_be_compared(tmp_path: Path) -> None:
    done = replay(late(tmp_path / "late.mcap", 5.0, 6.5))
    assert done.returncode == 2
    assert verdicts(done)["engines/state"] == verdicts(done)["effector/position"] == "unknown"
    assert "\nNothing can be compared: the record of 1 s shows too little\n" in done.stdout


def test_changed_recipe_differs_from_a_record_with_a_past(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "services", tmp_path / "services")
    for file, text, other, _ in (ACTIVITY, STATE):
        changed = tmp_path / "services" / file
        changed.write_text(changed.read_text().replace(text, other))
    done = replay(late(tmp_path / "late.mcap", 5.0), directory=tmp_path)
    assert verdicts(done)["operator_activity"] == verdicts(done)["engines/state"] == "DIFFERENT"


def test_other_topics_do_not_prolong_the_life_of_an_arm(tmp_path: Path) -> None:
    path = tmp_path / "robot.mcap"
    derived(path, lambda topic, it: it, ("/camera_info", -5 * SECOND), ("/map", 60 * SECOND))
    done = replay(path)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert "\nEqual within the bounds for 38 s\n" in done.stdout


def test_foreign_commands_after_the_arm_do_not_prolong_its_life(tmp_path: Path) -> None:
    path = tmp_path / "record.mcap"
    health = DiagnosticArray(
        status=[DiagnosticStatus(name="/camera", values=[KeyValue(key="pid", value="7")])]
    )
    state = topics.ENGINES_STATE
    recorder = Recorder(path, 0, SECOND)
    for second, topic, message in (
        (1, topics.DIAGNOSTICS, health),
        (2, topics.ENGINES, String(data=topics.TURN_ON)),
        (3, state, String(data=topics.OFF)),
        (4, state, String(data=topics.OFF)),
        (5, topics.ENGINES, String(data=topics.TURN_ON)),
        (6, topics.DIAGNOSTICS, health),
    ):
        data, at = serialize_message(message), second * SECOND
        recorder.message(topic.full_name("/"), topic.type_name, "", data, at, at)
    recorder.close()
    record = load(path)
    assert (record.begin, record.end) == (4 * SECOND, 5 * SECOND)


def test_parameters_are_those_that_the_health_shows(tmp_path: Path) -> None:
    """The record is that of a watchdog with a silence of three seconds."""

    def shown(topic: str, it: Received) -> Received:
        if topic != topics.DIAGNOSTICS.name:
            return it
        message = deserialize_message(it.data, DiagnosticArray)
        for status in message.status:
            if status.name == "/operator_watchdog":
                status.values = [*status.values, KeyValue(key="parameter silence", value="1.0")]
        return it._replace(data=serialize_message(message))

    done = replay(derived(tmp_path / "shown.mcap", shown))
    assert verdicts(done)["operator_activity"] == "DIFFERENT"


def test_whole_part_of_a_record_without_an_end_is_replayed(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(RECORD.read_bytes()[:-10])
    done = replay(path)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert done.stdout.startswith(f"{path} has no end: its ")


def test_command_with_a_bad_record_says_so_and_writes_nothing(tmp_path: Path) -> None:
    record = tmp_path / "record.mcap"
    record.write_bytes(b"Dear arm,\n")
    done = replay(record)
    assert done.returncode == 2
    assert done.stderr == f"{record} is no MCAP file\n"
    assert list(tmp_path.iterdir()) == [record]


def test_newest_record_is_replayed_and_named(tmp_path: Path) -> None:
    names = ("records/1.mcap", "chaos/1/record.mcap", "records/1.replayed.mcap", "chaos/1/notes")
    for modified, name in enumerate(names):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(RECORD, path)
        os.utime(path, (modified, modified))
    record = tmp_path / names[1]
    environment = os.environ | {"REACTIVE_ARM_RUN_DIR": str(tmp_path)}
    command = [sys.executable, "-m", "tests.replay"]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    first, *_, last = done.stdout.splitlines()
    assert first == f"Record: {record}"
    assert last == f"Output: {record.with_suffix('.replayed.mcap')}"


def test_without_any_record_one_line_says_so(tmp_path: Path) -> None:
    with pytest.raises(DeploymentError, match=f"There is no record in {tmp_path}: make record, or"):
        newest(tmp_path)


def test_missing_file_and_missing_arm_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(DeploymentError, match=f"^{tmp_path}/none.mcap: No such file or directory$"):
        load(tmp_path / "none.mcap")
    record = tmp_path / "other.mcap"
    recorder = Recorder(record, 0, SECOND)
    recorder.message("/other", "std_msgs/msg/Float64", "", serialize_message(Float64()), 0, 0)
    recorder.close()
    with pytest.raises(DeploymentError, match=f"^{record} contains no topic of an arm$"):
        load(record)
    done = replay(RECORD, "--namespace", "/arm2")
    assert (done.returncode, done.stderr) == (2, f"{RECORD} has no arm /arm2; it has /\n")


def text(*items: tuple[float, str]) -> list[Message]:
    return [Message(round(at * SECOND), serialize_message(String(data=data))) for at, data in items]


def test_turn_off_belongs_to_the_watchdog_while_it_misses_the_operator() -> None:
    activity = text((1.0, topics.ALIVE), (5.0, topics.INCAPACITATED), (8.0, topics.ALIVE))
    sent = text(
        (2.0, topics.TURN_OFF),
        (5.001, topics.TURN_OFF),
        (6.0, topics.TURN_ON),
        (7.0, topics.TURN_OFF),
        (9.0, topics.TURN_OFF),
    )
    record = Record(0, 10 * SECOND, 0, {"/operator_activity": activity, "/engines": sent})
    people, watchdog = chains.commands(record, "/")
    assert [message.sent / SECOND for message in people] == [2.0, 6.0, 9.0]
    assert [message.sent / SECOND for message in watchdog] == [5.001, 7.0]


def test_turn_off_at_the_begin_belongs_to_the_watchdog_that_was_silent() -> None:
    activity = text((8.0, topics.ALIVE))
    sent = text((0.5, topics.TURN_OFF), (7.5, topics.TURN_OFF), (9.0, topics.TURN_OFF))
    record = Record(0, 10 * SECOND, 0, {"/operator_activity": activity, "/engines": sent})
    people, watchdog = chains.commands(record, "/")
    assert [message.sent / SECOND for message in people] == [9.0]
    assert [message.sent / SECOND for message in watchdog] == [0.5, 7.5]


def test_only_latched_messages_from_before_the_arm_are_heard() -> None:
    old = Message(4 * SECOND, serialize_message(Float64(data=1.0)))
    commands = text((4.0, topics.TURN_ON), (6.0, topics.TURN_ON))
    record = Record(5 * SECOND, 10 * SECOND, 0, {"/l1": [old], "/engines": commands})
    (_, lengths), *_ = chains.inputs(record, "/", ("kinematics",))
    assert lengths == [old]
    heard = {topic.name: messages for topic, messages in chains.inputs(record, "/", ("engine_controller",))}
    assert {name for name, messages in heard.items() if messages} == {"engines"}
    assert heard["engines"] == commands[1:]


def transforms(at: float, *arms: str) -> Message:
    """Return a message of the transforms of the first frames of arms, without tf2_msgs."""
    frames = [(frame_id(BASE, arm), frame_id(LINK1, arm)) for arm in arms]
    return Message(round(at * SECOND), repr(frames).encode())


def read_transforms(data: bytes, kind: object) -> SimpleNamespace:
    frames = ast.literal_eval(data.decode())
    stamped = [
        TransformStamped(header=Header(frame_id=parent), child_frame_id=child) for parent, child in frames
    ]
    return SimpleNamespace(transforms=stamped)


def test_transforms_belong_to_the_arm_of_their_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chains, "deserialize_message", read_transforms)
    monkeypatch.setattr(chains, "is_babble", lambda topic, data: False)
    monkeypatch.setattr(chains, "TF", replace(topics.TF, type=object))
    sent = [transforms(1.0, "/arm1"), transforms(2.0, "/arm2"), transforms(3.0, "/"), transforms(4.0)]
    record = Record(0, 10 * SECOND, 0, {"/tf": [*sent, Message(5 * SECOND, b"unreadable")]})
    for namespace, at in (("/arm1", 1.0), ("/arm2", 2.0), ("/", 3.0), ("/arm3", None)):
        messages = chains.recorded(record, namespace, chains.TF)
        assert [message.sent / SECOND for message in messages] == ([] if at is None else [at])


def test_state_that_changes_later_than_its_bound_differs() -> None:
    def states(change: float) -> list[Message]:
        return text(*((n / 10, topics.ON if n / 10 < change else topics.OFF) for n in range(100)))

    assert compare(topics.ENGINES_STATE, states(5.0), states(5.5), []).is_equal
    late = compare(topics.ENGINES_STATE, states(5.0), states(5.9), [])
    assert not late.is_equal
    assert late.differences[0].replayed == topics.ON
    assert compare(topics.ENGINES_STATE, states(5.0), states(5.9), [(4 * SECOND, 7 * SECOND)]).is_equal


def test_state_that_is_repeated_too_seldom_differs() -> None:
    often, seldom = (text(*((n / rate, topics.ON) for n in range(10 * rate))) for rate in (10, 5))
    assert not compare(topics.ENGINES_STATE, often, seldom, []).is_equal


def test_answers_of_a_signal_may_come_two_at_a_time() -> None:
    """They follow the samples of its sources, which arrive seldomer."""

    def velocities(sent: Callable[[int], int], x: Callable[[int], float] = float) -> list[Message]:
        return [
            Message(
                sent(n) * 20_000_000,
                serialize_message(TwistStamped(twist=Twist(linear=Vector3(x=x(n))))),
            )
            for n in range(200)
        ]

    single = velocities(lambda n: n)
    assert compare(topics.EFFECTOR_TWIST, single, velocities(lambda n: n // 2 * 2), []).is_equal
    assert not compare(topics.EFFECTOR_TWIST, single, velocities(lambda n: n, lambda n: n + 0.5), []).is_equal


def test_presences_of_a_stepped_arm_are_equal_to_replayed_ones() -> None:
    def presences(ahead: int) -> list[Message]:
        return [
            Message(n * SECOND, serialize_message(Header(stamp=Time(sec=n + ahead))))
            for n in range(1000, 1100)
        ]

    assert compare(topics.OPERATOR_PRESENCE, presences(-600), presences(0), [], [0, -600 * SECOND]).is_equal
    assert not compare(topics.OPERATOR_PRESENCE, presences(-600), presences(0), []).is_equal


def test_times_of_a_stepped_arm_are_those_of_the_recorder(tmp_path: Path) -> None:
    path = tmp_path / "record.mcap"
    recorder = Recorder(path, 0, 1000 * SECOND)
    step = InjectedFault(STEP, NO_TARGET, 0.0, 0.0, ahead=-600.0)
    recorder.event(FAULTS, 0, step._asdict() | {"namespace": "/"})
    data = serialize_message(String(data=topics.ON))
    for sent, ahead in ((1, 0), (2, -600)):
        received, stamp = sent * SECOND + 1000, (sent + ahead) * SECOND
        recorder.message("/engines/state", topics.ENGINES_STATE.type_name, "", data, received, stamp)
    recorder.close()
    record = load(path)
    assert [sent for sent, _ in record.of(topics.ENGINES_STATE, "/")] == [1001 * SECOND, 1002 * SECOND]
    assert set(record.offsets) == {0, -600 * SECOND}
