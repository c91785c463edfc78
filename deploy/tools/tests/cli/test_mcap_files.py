"""MCAP files of every legal form, files without an end, and a disk that is full."""

from __future__ import annotations

import errno
import gc
import itertools
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import zstandard
from mcap.writer import CompressionType, IndexType, Writer

from mcap_files import FileWriter, McapFile, UnreadableError

T0 = 1_700_000_000_000_000_000
MESSAGES = 300


def write(writer: Writer, count: int = MESSAGES) -> None:
    """Write messages of one topic, a millisecond apart, and one of a channel without a schema."""
    schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
    chatter = writer.register_channel("/chatter", "cdr", schema)
    other = writer.register_channel("/app/log", "json", 0)
    writer.add_message(other, T0, b'{"a": 1}', T0)
    for number in range(count):
        writer.add_message(chatter, T0 + number * 10**6, b"\0\1\0\0" + number.to_bytes(4, "little"), T0)


def written(path: Path, *, profile: str = "ros2", **options: Any) -> Path:
    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start(profile=profile, library="test")
        writer.add_metadata("arm", {"origin": "7"})
        write(writer)
        writer.finish()
    return path


def numbers(path: Path, **limits: Any) -> list[int]:
    with McapFile(path) as file:
        messages = [message.data for _, message in file.messages(["/chatter"], **limits)]
    return [int.from_bytes(data[4:], "little") for data in messages]


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"chunk_size": 500},
        {"chunk_size": 500, "compression": CompressionType.LZ4},
        {"use_chunking": False},
        {"repeat_schemas": False},
        {"repeat_channels": False},
        {"use_statistics": False},
        {"index_types": IndexType.NONE},
        {"index_types": IndexType.CHUNK},
        {"use_summary_offsets": False},
        {"profile": ""},
        {
            "repeat_schemas": False,
            "repeat_channels": False,
            "use_statistics": False,
            "use_summary_offsets": False,
            "index_types": IndexType.NONE,
        },
    ],
    ids=str,
)
def test_every_legal_file_is_read(options: dict[str, Any], tmp_path: Path) -> None:
    path = written(tmp_path / "x.mcap", **options)
    with McapFile(path) as file:
        topics = {file.channels[number].topic: count for number, count in file.counts.items()}
        types = {channel.topic: file.type_name(channel) for channel in file.channels.values()}
        assert (file.start, file.end) == (T0, T0 + (MESSAGES - 1) * 10**6)
        assert [each.metadata for each in file.metadata] == [{"origin": "7"}]
        assert file.remark == ""
    assert topics == {"/chatter": MESSAGES, "/app/log": 1}
    assert types == {"/chatter": "std_msgs/msg/String", "/app/log": ""}
    assert numbers(path) == list(range(MESSAGES))
    assert numbers(path, begin=T0 + 10 * 10**6, end=T0 + 12 * 10**6) == [10, 11, 12]
    assert numbers(path, begin=T0 + 10**12, end=T0 + 10**12) == []
    assert numbers(path, begin=T0 + 10**12, end=T0) == []


def test_compressed_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap.zstd"
    path.write_bytes(zstandard.compress(written(tmp_path / "x.mcap").read_bytes()))
    assert numbers(path) == list(range(MESSAGES))


def test_compressed_messages_are_read(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    writer = FileWriter(path, "test")
    channel = writer.register_channel("/chatter", "cdr", writer.register_schema("a/msg/B", "ros2msg", b""))
    streamed = zstandard.ZstdCompressor().compressobj()  # without the size of its content
    for data in (
        zstandard.compress(b"\0\1\0\0\5\0\0\0"),
        streamed.compress(b"\0\1\0\0\6\0\0\0") + streamed.flush(),
        zstandard.compress(b"\0\1\0\0\7\0\0\0")[:7],
    ):
        writer.add_message(channel, T0, data, T0)
    writer.close()
    assert numbers(path)[:2] == [5, 6]


@pytest.mark.parametrize("options", [{"chunk_size": 500}, {"use_chunking": False}], ids=str)
def test_whole_messages_of_a_file_without_an_end_are_read(options: dict[str, Any], tmp_path: Path) -> None:
    whole = written(tmp_path / "x.mcap", **options).read_bytes()
    path = tmp_path / "cut.mcap"
    before = 0
    for length in range(8, len(whole), 97):
        path.write_bytes(whole[:length])
        found = numbers(path)
        assert found == list(range(len(found)))
        assert len(found) >= before
        before = len(found)
        with McapFile(path) as file:
            assert not file.is_complete
    assert before == MESSAGES
    path.write_bytes(whole[: len(whole) // 2])
    with McapFile(path) as file:
        count = file.counts.total()
        expected = f"{path} has no end: its {count} whole messages of 0.1 s are read"
        assert 0 < count < MESSAGES
        assert file.remark.startswith(expected[:-20])


@pytest.mark.parametrize("tail", [bytes(4096), b"\xff" * 4096], ids=["zeros", "garbage"])
def test_blocks_that_lost_their_content_end_a_file(tail: bytes, tmp_path: Path) -> None:
    """A file system may write the length of a file before its last blocks."""
    whole = written(tmp_path / "x.mcap", chunk_size=500).read_bytes()
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole[: len(whole) // 2] + tail)
    found = numbers(path)
    assert found == list(range(len(found)))
    assert len(found) > MESSAGES // 4


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda data: b"", "is no MCAP file"),
        (lambda data: data[:5], "is no MCAP file"),
        (lambda data: b"Dear arm,\n", "is no MCAP file"),
        (lambda data: data[:200] + b"\xff" + data[201:], "is damaged: "),
    ],
    ids=["empty", "five bytes", "letter", "damaged"],
)
def test_unreadable_file_is_one_line(change: Callable[[bytes], bytes], reason: str, tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(change(written(path, compression=CompressionType.NONE).read_bytes()))
    with pytest.raises(UnreadableError) as error, McapFile(path) as file:
        list(file.messages())
    assert str(error.value).startswith(f"{path} {reason}")
    assert "\n" not in str(error.value)


def test_saved_messages_survive_the_writer(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    writer = FileWriter(path, "test")
    write(writer, 100)
    assert numbers(path) == []
    writer.save()
    assert numbers(path) == list(range(100))
    writer.close()
    assert numbers(path) == list(range(100))
    with McapFile(path) as file:
        assert file.is_complete


def test_file_that_grows_has_what_it_had_when_it_was_opened(tmp_path: Path) -> None:
    path = tmp_path / "growing.mcap"
    writer = FileWriter(path, "test")
    write(writer)
    writer.save()
    with McapFile(path) as file:
        write(writer)  # on a new channel
        writer.save()
        assert len([*file.messages()]) == file.counts.total() == 1 + MESSAGES
    writer.close()
    assert len(numbers(path)) == 2 * MESSAGES


def test_chunks_of_weeks_are_not_kept_in_memory(tmp_path: Path) -> None:
    path = tmp_path / "weeks.mcap"
    writer = FileWriter(path, "test")
    channels = [writer.register_channel(f"/{number}", "cdr", 0) for number in range(20)]
    times = iter(range(2_000))

    def save(count: int) -> int:
        for time in itertools.islice(times, count):
            for channel in channels:
                writer.add_message(channel, T0 + time, b"", T0)
            writer.save()
        gc.collect()
        return sys.getallocatedblocks()

    before = save(1_000)
    assert save(1_000) - before < 1_000  # half a block for each chunk, which has 20 places
    writer.close()
    with McapFile(path) as file:
        found = [message.log_time for _, message in file.messages(["/19"], begin=T0 + 1_998)]
    assert found == [T0 + 1_998, T0 + 1_999]


def test_each_save_waits_for_the_disk_on_another_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int] = []
    submit = ThreadPoolExecutor.submit
    monkeypatch.setattr(os, "fdatasync", synced.append)
    submitted: list[Any] = []

    def noting(self: Any, work: Any, *arguments: Any) -> Any:
        submitted.append(work)
        future = submit(self, work, *arguments)
        future.result()
        return future

    monkeypatch.setattr(ThreadPoolExecutor, "submit", noting)
    writer = FileWriter(tmp_path / "x.mcap", "test")
    writer.save()
    writer.save()
    assert len(synced) == len(submitted) == 2
    writer.close()


class FullDisk:
    """In place of a file: takes some bytes, then no more."""

    def __init__(self, file: Any) -> None:
        self._file, self.room = file, sys.maxsize

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def write(self, data: Any) -> int:
        if not self.room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        taken = self._file.write(data[: self.room])
        self.room -= taken
        return int(taken)


@pytest.mark.parametrize("room", [0, 500, 5000])
def test_full_disk_is_one_line_and_keeps_what_is_whole(
    room: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "x.mcap"
    disk = FullDisk(path.open("xb", buffering=0))
    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", lambda *_, **options: disk)
        writer = FileWriter(path, "test", compression=CompressionType.NONE)
    write(writer, 10)
    writer.save()
    size = path.stat().st_size
    disk.room = room
    write(writer, 10_000)
    with pytest.raises(OSError, match=r"No space left on device, [\d.]+ MB are free") as error:
        writer.save()
    assert error.value.filename == str(path)
    assert path.stat().st_size == size
    writer.close()  # has nothing to add
    assert numbers(path) == list(range(10))
