"""Replay: a bag and programs in, what the programs publish out."""

from __future__ import annotations

import os
import subprocess
import sys
import tracemalloc
from _thread import interrupt_main
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PointStamped, TransformStamped
from mcap.writer import CompressionType
from mcap_files import McapFile, rosbag2
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_msgs.msg import Bool, Float64, Header, String
from tests.simulation_kit.tests import replayed

from rclpy_simulation.replay.bag import Bag
from rclpy_simulation.replay.command import main
from rclpy_simulation.replay.lives import Run, Suspension
from rclpy_simulation.replay.replay import replay

SECOND = 10**9
BEGIN = 1_700_000_000 * SECOND
PROGRAMS = replayed.__name__
SCALE = f"{PROGRAMS}:scale"

Message = tuple[int, str, Any]
"""Log time [ns from the beginning], topic, message."""


def point(x: float, stamp: int = 0) -> PointStamped:
    time = BEGIN + stamp
    header = Header(stamp=Time(sec=time // SECOND, nanosec=time % SECOND), frame_id="abc")
    return PointStamped(header=header, point=Point(x=x))


def points(count: int = 100) -> list[Message]:
    return [(n * SECOND // 100, "/point", point(float(n), n * SECOND // 100)) for n in range(count)]


FACTOR: Message = (SECOND // 10, "/factor", String(data="2.0"))
"""It was sent before the beginning, as latched messages are."""


def write(
    path: Path,
    messages: Iterable[Message],
    begin: int = BEGIN,
    hashes: bool = True,
    padding: bytes = b"",
    **options: Any,
) -> Path:
    options = {"compression": CompressionType.NONE} | options
    writer = rosbag2.TopicWriter(path, "test", **options)
    channels: dict[str, int] = {}
    for time, name, message in messages:
        if name not in channels:
            qos = replayed.LATCHED if name in ("/factor", "/ready") else QoSProfile(depth=10)
            type_name = f"{type(message).__module__.split('.')[0]}/msg/{type(message).__name__}"
            channels[name] = writer.add_topic(rosbag2.Topic(name, type_name, [qos]))
        sent = begin - SECOND if name == "/factor" else begin + time
        writer.add_message(channels[name], begin + time, serialize_message(message) + padding, sent)
    writer.close()
    return path


def read(path: Path, topic: str, message_type: Any) -> list[tuple[float, Any]]:
    """Return the messages of a topic and their times [s from the beginning]."""
    with McapFile(path) as file:
        return [
            ((message.log_time - BEGIN) / SECOND, deserialize_message(message.data, message_type))
            for _, message in file.messages([topic])
        ]


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return write(tmp_path / "in.mcap", [*points(10), FACTOR, *points()[10:]])


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out.mcap"


def test_output_is_what_the_program_makes_of_the_bag(bag: Path, out: Path) -> None:
    assert main(["replay", str(bag), "--run", SCALE, "--output", str(out)]) == 0
    scaled = read(out, "/scaled", PointStamped)
    # The factor is latched, and was sent before: it comes first, as to the program that was recorded.
    assert [message.point.x for _, message in scaled] == [2.0 * n for n in range(100)]
    assert [time for time, _ in scaled] == pytest.approx([n / 100 for n in range(100)], abs=0.001)
    # The programs have the time of day of the record, and what they published before it is at its beginning.
    times = [message.data - BEGIN / SECOND for _, message in read(out, "/times", Float64)]
    assert times == pytest.approx([n / 100 for n in range(100)], abs=0.001)
    assert read(out, "/ready", String) == [(0.0, String(data="ready"))]
    with Bag([out]) as written:
        assert written.topics.keys() == {"/scaled", "/times", "/ready"}
        assert written.topics["/ready"].offered[0].durability == replayed.LATCHED.durability
        assert written.topics["/scaled"].type_hash.startswith("RIHS01_")


@pytest.mark.parametrize(
    "options",
    [
        {"compression": CompressionType.ZSTD},
        {"compression": CompressionType.LZ4, "chunk_size": 1000},
        {"use_chunking": False},
    ],
)
def test_each_form_of_a_bag_gives_the_same_octets(
    bag: Path, out: Path, tmp_path: Path, options: dict[str, Any]
) -> None:
    other = write(tmp_path / "other.mcap", [*points(10), FACTOR, *points()[10:]], **options)
    assert main(["replay", str(bag), "--run", SCALE, "--output", str(out)]) == 0
    assert main(["replay", str(other), "--run", SCALE, "--output", str(tmp_path / "same.mcap")]) == 0
    assert (tmp_path / "same.mcap").read_bytes() == out.read_bytes()


def test_files_of_a_directory_and_several_bags_are_one_record(bag: Path, out: Path, tmp_path: Path) -> None:
    split = tmp_path / "split"
    split.mkdir()
    write(split / "a_0.mcap", points(50))
    write(split / "a_1.mcap", points()[50:])
    factor = write(tmp_path / "factor.mcap", [FACTOR])
    assert main(["replay", str(bag), "--run", SCALE, "--output", str(out)]) == 0
    same = tmp_path / "same.mcap"
    assert main(["replay", str(split), str(factor), "--run", SCALE, "--output", str(same)]) == 0
    assert same.read_bytes() == out.read_bytes()


def test_other_interpreters_write_the_same_octets(bag: Path, out: Path, tmp_path: Path) -> None:
    arguments = ["replay", str(bag), "--run", SCALE, "--loss", "0.1", "--output"]
    assert main([*arguments, str(out)]) == 0
    for seed in ("1", "2"):
        same = tmp_path / f"{seed}.mcap"
        command = [sys.executable, "-m", "rclpy_simulation", *arguments, str(same)]
        subprocess.run(command, env=os.environ | {"PYTHONHASHSEED": seed}, check=True, timeout=60)
        assert same.read_bytes() == out.read_bytes()
    assert main([*arguments, str(same), "--seed", "1"]) == 0
    assert same.read_bytes() != out.read_bytes()


def test_programs_hear_each_other_and_have_arguments_of_their_own(bag: Path, out: Path) -> None:
    words = ["--run", PROGRAMS, "--ros-args", "-p", "offset:=1.0", "-r", "point:=/point", "--host", "robot"]
    recorded_too = write(bag.with_name("scaled.mcap"), [(n, "/scaled", point(9.0)) for n in range(5)])
    relay = ["--run", f"{PROGRAMS}:relay", "--host", "other"]
    assert main(["replay", str(bag), str(recorded_too), *words, *relay, "--output", str(out)]) == 0
    again = read(out, "/again", PointStamped)
    assert [message.point.x for _, message in again] == [
        2.0 * n + 1.0 for n in range(100)
    ]  # not the recorded


def test_latency_a_parameter_file_and_variables_are_those_asked_for(
    bag: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (bag.parent / "p.yaml").write_text("/scale: {ros__parameters: {offset: 3.0}}")
    words = ["--run", SCALE, "--ros-args", "--params-file", str(bag.parent / "p.yaml"), "--rosout"]
    shown = ["--run", f"{PROGRAMS}:show_environment", "--env", "COLOR=red", "--show"]
    assert main(["replay", str(bag), *words, *shown, "--latency", "50", "--output", str(out)]) == 0
    scaled = read(out, "/scaled", PointStamped)
    assert [message.point.x for _, message in scaled] == [2.0 * n + 3.0 for n in range(100)]
    assert [time for time, _ in scaled] == pytest.approx([n / 100 + 0.05 for n in range(100)], abs=0.001)
    assert "'COLOR': 'red'" in capsys.readouterr().err
    with Bag([out]) as written:
        assert "/parameter_events" in written.topics


def test_transforms_are_as_any_topic(out: Path, tmp_path: Path) -> None:
    pytest.importorskip("tf2_msgs", reason="platform: no tf2_msgs")
    from tf2_msgs.msg import TFMessage

    stamped = [TransformStamped(child_frame_id=f"frame{n}") for n in range(10)]
    messages = [(n * SECOND // 10, "/tf", TFMessage(transforms=[each])) for n, each in enumerate(stamped)]
    bag = write(tmp_path / "in.mcap", messages)
    assert main(["replay", str(bag), "--run", f"{PROGRAMS}:hear_transforms", "--output", str(out)]) == 0
    assert [message.data for _, message in read(out, "/frames", String)] == [f"frame{n}" for n in range(10)]


def test_a_forced_topic_is_fed_and_a_muted_one_is_not(bag: Path, out: Path) -> None:
    recorded = write(bag.with_name("scaled.mcap"), [(n, "/scaled", point(9.0)) for n in range(5)])
    words = ["--run", SCALE, "--run", f"{PROGRAMS}:relay", "--output", str(out)]
    assert main(["replay", str(bag), str(recorded), *words, "--feed", "/scaled", "--mute", "/point"]) == 0
    assert [message.point.x for _, message in read(out, "/again", PointStamped)] == [9.0] * 5


def test_a_topic_is_fed_until_a_program_publishes_it(
    bag: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--run", SCALE, "--run", f"{PROGRAMS}:publish_late", "--output", str(out), "--until", "1.5"]
    longer = write(bag.with_name("longer.mcap"), [*points(200), FACTOR])
    assert main(["replay", str(longer), *words]) == 0
    assert 98 <= len(read(out, "/scaled", PointStamped)) <= 102
    assert "/point was fed until 1.01" in capsys.readouterr().out


def test_recorded_clock_is_that_of_the_programs(out: Path, tmp_path: Path) -> None:
    clock = [(t * SECOND // 100, "/clock", Clock(clock=Time(sec=t // 100 + 5))) for t in range(300)]
    messages = sorted([*clock, *points(), FACTOR], key=lambda each: each[0])
    bag = write(tmp_path / "in.mcap", messages)
    assert main(["replay", str(bag), "--run", SCALE, "--output", str(out)]) == 0
    assert {message.data for _, message in read(out, "/times", Float64)[2:]} == {5.0}
    own = ["--ros-args", "-p", "use_sim_time:=false"]
    assert main(["replay", str(bag), "--run", SCALE, *own, "--output", str(out)]) == 0
    assert read(out, "/times", Float64)[0][1].data >= BEGIN / SECOND


def test_log_times_are_the_clock_of_programs_that_want_one(bag: Path, out: Path) -> None:
    words = ["--run", SCALE, "--ros-args", "-p", "use_sim_time:=true", "--output", str(out)]
    assert main(["replay", str(bag), *words]) == 0
    times = [message.data - BEGIN / SECOND for _, message in read(out, "/times", Float64)]
    assert times[5:] == pytest.approx([n / 100 for n in range(5, 100)], abs=0.02)


def test_stamps_are_the_times_if_asked(out: Path, tmp_path: Path) -> None:
    late = [(time + SECOND, *rest) for time, *rest in points()]
    late[3], late[4] = (late[4][0], *late[3][1:]), (late[3][0], *late[4][1:])  # overtaken
    bag = write(tmp_path / "in.mcap", [(0, "/other", Bool()), FACTOR, *late])
    words = ["--run", SCALE, "--output", str(out)]
    assert main(["replay", str(bag), *words, "--by", "stamp"]) == 0
    scaled = read(out, "/scaled", PointStamped)
    assert [message.point.x for _, message in scaled] == [2.0 * n for n in range(100)]
    assert [time for time, _ in scaled] == pytest.approx([n / 100 for n in range(100)], abs=0.001)
    assert main(["replay", str(bag), *words]) == 0
    assert read(out, "/scaled", PointStamped)[3][1].point.x == 8.0


def test_a_program_lives_from_its_start_until_it_is_killed(
    bag: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = ["--run", SCALE, "--kill", "0.3005"], ["--run", SCALE, "--start=0.5", "--host", "other"]
    assert main(["replay", str(bag), *first, *second, "--output", str(out), "--from", "0.1"]) == 0
    scaled = [round(message.point.x / 2) for _, message in read(out, "/scaled", PointStamped)]
    assert scaled == [*range(10, 31), *range(scaled[21], 100)]
    assert 50 < scaled[21] < 55  # it has to discover the others
    assert "ended" not in capsys.readouterr().out


def test_a_run_is_suspended_at_its_times(bag: Path, out: Path) -> None:
    begin = BEGIN + SECOND // 2 - SECOND // 1000
    for is_stop in (True, False):
        run = Run(SCALE, suspensions=[Suspension(begin, begin + SECOND // 4, is_stop)])
        with Bag([bag]) as opened:
            replay(opened, [run], out)
        scaled = read(out, "/scaled", PointStamped)
        times = [time for time, _ in scaled]
        assert max(b - a for a, b in pairwise(times)) == pytest.approx(0.259, abs=0.002)
        assert [message.point.x for _, message in scaled][:50] == [2.0 * n for n in range(50)]


def test_a_part_is_replayed_with_the_latched_messages_of_before(bag: Path, out: Path) -> None:
    words = ["--run", SCALE, "--output", str(out), "--from", "0.5", "--until", "0.7", "--epoch", "1000"]
    assert main(["replay", str(bag), *words]) == 0
    assert [message.point.x for _, message in read(out, "/scaled", PointStamped)] == [
        2.0 * n for n in range(50, 71)
    ]
    assert read(out, "/times", Float64)[0][1].data == pytest.approx(1000.0, abs=0.001)


def test_a_bag_is_read_while_it_is_replayed(tmp_path: Path) -> None:
    image = Image(data=bytes(400_000))
    bag = write(tmp_path / "in.mcap", ((n * SECOND // 10, "/image", image) for n in range(100)))
    tracemalloc.start()
    try:
        with Bag([bag]) as opened:
            assert sum(1 for _ in opened.messages()) == 100
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 8_000_000 < bag.stat().st_size


# What it says


def compared(bag: Path, out: Path, capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, list[str]]:
    code = main(["replay", str(bag), "--run", SCALE, "--output", str(out), "--compare", *words])
    return code, [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]


def test_equal_output_is_equal_whatever_its_padding(
    out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scaled = [(time + 100, "/scaled", point(2.0 * n, time)) for n, (time, *_) in enumerate(points())]
    messages = sorted([*points(), FACTOR, *scaled], key=lambda each: each[0])
    bag = write(tmp_path / "in.mcap", messages, padding=bytes(4))
    code, lines = compared(bag, out, capsys)
    assert code == 0
    assert lines[1:3] == ["/scaled 100 100 0", "Equal"]


def test_what_differs_is_named_with_its_field_and_first_time(
    out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scaled = [(time + 100, "/scaled", point(2.0 * n, time)) for n, (time, *_) in enumerate(points())]
    scaled[30][2].point.y = 0.5
    del scaled[60]
    bag = write(tmp_path / "in.mcap", sorted([*points(), FACTOR, *scaled], key=lambda each: each[0]))
    code, lines = compared(bag, out, capsys)
    assert code == 1
    assert lines[1:3] == [
        "/scaled 99 100 2",
        "first at 0.300 s: point.y: recorded 0.5, replayed 0.0",
    ]
    assert "Different: /scaled" in lines
    assert compared(bag, out, capsys, "--tolerance", "0.5")[1][1] == "/scaled 99 100 1"


def test_a_program_that_fails_is_named_with_its_last_words(
    bag: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(bag), "--run", f"{PROGRAMS}:fail", "--output", str(out)]) == 1
    text = capsys.readouterr().out
    assert f"{PROGRAMS}:fail ended with exit code 1 at 0.000 s\n" in text
    assert "RuntimeError: no point\n" in text


def test_a_package_that_is_missing_is_named_with_where_it_comes_from(
    bag: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(bag), "--run", f"{PROGRAMS}:import_missing", "--output", str(out)]) == 1
    line = "    tf2_nothing is missing. Of ROS 2, PyPI has rclpy and common_interfaces only: install "
    assert line in capsys.readouterr().out


def test_a_program_that_waits_for_a_service_is_named_and_not_waited_for(
    bag: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--run", f"{PROGRAMS}:wait", "--run", SCALE, "--output", str(out)]
    assert main(["replay", str(bag), *words]) == 0
    assert "/deep/waiting waits for the service /deep/power, which nobody serves\n" in capsys.readouterr().out


def test_programs_see_the_end_as_sigint(bag: Path, out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--run", SCALE, "--run", f"{PROGRAMS}:stay", "--output", str(out), "--show"]
    assert main(["replay", str(bag), *words]) == 1
    streams = capsys.readouterr()
    assert streams.err == f"[{SCALE}] interrupted\n"
    assert f"{PROGRAMS}:stay did not end within 10 s of SIGINT, and was killed" in streams.out
    assert f"{SCALE} " not in streams.out


def test_a_type_with_another_definition_is_not_fed(
    out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def other(type_name: str) -> tuple[str, bytes]:
        text = b"# A comment\nstd_msgs/Header   header\nPoint point" + extra
        nested = b"=" * 80 + b"\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y # up\n\nfloat64 z\n"
        return "ros2msg", text + b"\n" + nested

    def has_output(name: str) -> bool:
        with monkeypatch.context() as patched:
            patched.setattr(rosbag2, "definition", other)
            bag = write(tmp_path / name, points())
        assert main(["replay", str(bag), "--run", SCALE, "--output", str(out)]) == 0
        return bool(read(out, "/scaled", PointStamped))

    extra = b"\nint8 more"
    assert not has_output("other.mcap")
    line = "/point is not fed: the definition of geometry_msgs/msg/PointStamped is not that of the installed"
    assert line in capsys.readouterr().out


def test_no_such_program_is_one_line(bag: Path, out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(bag), "--run", "nothing.here", "--output", str(out)]) == 2
    assert capsys.readouterr().err == "No module named 'nothing'\n"
    assert not list(out.parent.glob("*out*"))
    assert main(["replay", str(bag), "--run", f"{PROGRAMS}:nothing", "--output", str(out)]) == 1
    assert "replayed' has no attribute 'nothing'\n" in capsys.readouterr().out


def test_ctrl_c_ends_the_replay_and_is_seen_by_no_program(
    bag: Path, out: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def read_on(*arguments: Any, **options: Any) -> Iterator[Any]:
        yield from original(*arguments, **options)
        interrupt_main()

    original = Bag.messages
    monkeypatch.setattr(Bag, "messages", read_on)
    assert main(["replay", str(bag), "--run", SCALE, "--output", str(out), "--show"]) == 130
    assert capsys.readouterr().err == ""
    assert not list(out.parent.glob("*out*"))


def test_a_bag_that_is_damaged_missing_or_of_sqlite_is_one_line(
    bag: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--run", SCALE, "--output", str(out)]
    data = bytearray(bag.read_bytes())
    data[len(data) // 3] ^= 255
    bag.write_bytes(data)
    assert main(["replay", str(bag), *words]) == 2
    assert "is damaged" in capsys.readouterr().err
    (bag.parent / "sqlite").mkdir()
    (bag.parent / "sqlite" / "sqlite_0.db3").touch()
    assert main(["replay", str(bag.parent / "sqlite"), *words]) == 2
    assert "ros2 bag convert" in capsys.readouterr().err
    assert main(["replay", str(bag.with_name("none")), *words]) == 2
    assert "No such file" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["in.mcap"],
        ["in.mcap", "--run", "x"],
        ["in.mcap", "--run", "x", "--until", "soon"],
        ["in.mcap", "--run", "x", "--loss", "5"],
        ["in.mcap", "--run", "x", "--kill", "soon", "--compare"],
    ],
)
def test_a_wrong_command_line_is_refused(words: Sequence[str]) -> None:
    with pytest.raises(SystemExit) as error:
        main(["replay", *words])
    assert error.value.code == 2
