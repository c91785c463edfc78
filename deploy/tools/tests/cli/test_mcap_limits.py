"""Files of strangers: a few kB that would take gigabytes of disk or memory, lengths and indexes that lie."""

from __future__ import annotations

import contextlib
import io
import itertools
import random
import struct
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import lz4.frame
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Chunk, MetadataIndex, Schema
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from mcap_files import McapFile, UnreadableError

MB = 1_000_000
LIMIT = 256 * MB
TOO_MANY = "its messages need more memory than the limit of 1000 MB"
T0 = 1_700_000_000_000_000_000


class Forger(Writer):
    """A writer whose indexes may lie."""

    def __init__(self, **options: Any) -> None:
        self.file = io.BytesIO()
        super().__init__(self.file, **options)
        self.start(profile="ros2", library="test")
        schema = self.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        self.channel = self.register_channel("/chatter", "cdr", schema)

    def own(self, name: str) -> Any:
        self.flush()  # type: ignore[no-untyped-call]
        return getattr(self, f"_Writer__{name}")

    def messages(self, count: int, data: bytes = b"\0\1\0\0\0\0\0\0") -> None:
        for number in range(count):
            self.add_message(self.channel, T0 + number, data, T0)

    def content(self) -> bytes:
        self.finish()  # type: ignore[no-untyped-call]
        return self.file.getvalue()

    def opened(self, folder: Path) -> McapFile:
        path = folder / "x.mcap"
        path.write_bytes(self.content())
        return McapFile(path)


def zstd(size: int, head: bytes = b"", *, declared: bool = False) -> bytes:
    """Return a few kB that unpack to a head and zeros."""
    packer = zstandard.ZstdCompressor(level=19).compressobj(size=size if declared else -1)
    pieces = [packer.compress(head)]
    for left in range(size - len(head), 0, -16 * MB):
        pieces.append(packer.compress(bytes(min(left, 16 * MB))))
    return b"".join([*pieces, packer.flush()])


def lz4_frame(size: int) -> bytes:
    packer = lz4.frame.LZ4FrameCompressor(block_size=lz4.frame.BLOCKSIZE_MAX4MB)
    pieces = [packer.begin()] + [packer.compress(bytes(4 * MB)) for _ in range(size // (4 * MB))]
    return b"".join([*pieces, packer.flush()])


def record(kind: Any) -> bytes:
    builder = RecordBuilder()
    kind.write(builder)
    return bytes(builder.end())


def of(*records: bytes) -> bytes:
    """Return a file that has these records and no summary."""
    end = struct.pack("<BQI", Opcode.DATA_END, 4, 0) + struct.pack("<BQQQI", Opcode.FOOTER, 20, 0, 0, 0)
    return b"".join([Forger(use_chunking=False).file.getvalue(), *records, end, MCAP0_MAGIC])


def chunk(compression: str, data: bytes, declared: int) -> bytes:
    return record(Chunk(compression, data, T0, T0, 0, declared))


def compressed_messages() -> bytes:
    file = Forger()
    file.messages(3, zstd(800 * MB, b"\0\1\0\0"))
    return file.content()


def schemas_in_chunks() -> bytes:
    schemas = (record(Schema(number, bytes(100 * MB), "ros2msg", "a")) for number in range(1, 4))
    return of(*(chunk("zstd", zstandard.compress(each), len(each)) for each in schemas))


def chunks_of_one_time() -> bytes:
    file = Forger(chunk_size=1000)
    file.messages(6, bytes(60 * MB))
    file.own("chunk_indices")[:] = [
        replace(each, message_start_time=0, message_end_time=T0 + 9) for each in file.own("chunk_indices")
    ]
    return file.content()


BOMBS: dict[str, tuple[Callable[[], bytes], str]] = {
    "file": (lambda: zstd(1200 * MB, MCAP0_MAGIC), "unpacks to more than the limit of 256 MB: unpack it"),
    "chunk": (lambda: of(chunk("zstd", zstd(400 * MB, declared=True), 400 * MB)), "a chunk has 400 MB, more"),
    "stream": (lambda: of(chunk("zstd", zstd(400 * MB), 1000)), "not the 1000 bytes that it declares"),
    "frame": (
        lambda: of(chunk("zstd", zstd(400 * MB, declared=True), 1000)),
        "not the 1000 bytes that it declares",
    ),
    "lz4": (lambda: of(chunk("lz4", lz4_frame(400 * MB), 1000)), "not the 1000 bytes that it declares"),
    "less": (lambda: of(chunk("zstd", zstd(9), 90 * MB)), "not the 90000000 bytes that it declares"),
    "exabytes": (lambda: of(chunk("", b"", 1 << 62)), "more than the limit of 256 MB"),
    "messages": (compressed_messages, "a message unpacks to more than the limit of 256 MB"),
    "schemas": (schemas_in_chunks, "its schemas, channels and metadata have 300 MB, more than the limit"),
    "one time": (chunks_of_one_time, "the chunks of one time have 300 MB, more than the limit of 256 MB"),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_bomb_is_refused_in_one_line(bomb: str, tmp_path: Path) -> None:
    make, reason = BOMBS[bomb]
    path = tmp_path / "x.mcap"
    path.write_bytes(make())
    assert path.stat().st_size < 2 * MB
    tracemalloc.start()
    with pytest.raises(UnreadableError) as error, McapFile(path) as file:
        for _ in file.messages():
            pass
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert reason in str(error.value)
    assert str(error.value).startswith(f"{path} is ")
    assert "\n" not in str(error.value)
    assert peak < 3 * LIMIT


def test_messages_that_a_program_keeps_have_a_limit(tmp_path: Path) -> None:
    file = Forger()
    file.messages(12, bytes(100 * MB))
    with file.opened(tmp_path) as kept, pytest.raises(UnreadableError, match=TOO_MANY):
        for _ in kept.kept(["/chatter"]):
            pass


def test_file_that_declares_too_many_messages_is_not_kept(tmp_path: Path) -> None:
    file = Forger()
    file.messages(2)
    file.own("statistics").message_count = file.own("statistics").channel_message_counts[1] = 1 << 60
    with file.opened(tmp_path) as kept, pytest.raises(UnreadableError, match=TOO_MANY):
        next(kept.kept(["/chatter"]))


def test_chunk_that_is_indexed_twice_is_read_once(tmp_path: Path) -> None:
    file = Forger()
    file.messages(5)
    indexes = file.own("chunk_indices")
    indexes += 999 * indexes
    file.own("statistics").chunk_count = len(indexes)
    with file.opened(tmp_path) as read:
        assert len(list(read.messages())) == read.counts.total() == 5


def test_metadata_that_is_indexed_twice_is_read_once(tmp_path: Path) -> None:
    file = Forger()
    file.add_metadata("arm", {"origin": "7"})
    file.messages(5)
    indexes = file.own("metadata_indexes")
    indexes += 999 * indexes
    file.own("statistics").metadata_count = len(indexes)
    with file.opened(tmp_path) as read:
        assert [each.metadata for each in read.metadata] == [{"origin": "7"}]


def test_index_of_metadata_that_points_elsewhere_is_not_followed(tmp_path: Path) -> None:
    file = Forger()
    file.messages(5)
    file.own("metadata_indexes").append(MetadataIndex(8, 30, "arm"))
    file.own("statistics").metadata_count = 1
    with file.opened(tmp_path) as read:
        assert (read.metadata, read.counts.total()) == ([], 5)


def test_big_file_takes_the_memory_of_a_few_chunks(tmp_path: Path) -> None:
    file, path = Forger(chunk_size=MB), tmp_path / "x.mcap"
    file.messages(200, random.Random(1).randbytes(MB))
    path.write_bytes(file.content())
    tracemalloc.start()
    with McapFile(path) as read:
        assert sum(1 for _ in read.messages()) == 200
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 20 * MB


@pytest.mark.parametrize("options", [{"chunk_size": 300}, {"use_chunking": False}], ids=str)
def test_lengths_that_lie_are_one_line(options: dict[str, Any], tmp_path: Path) -> None:
    file, path = Forger(compression=CompressionType.NONE, **options), tmp_path / "x.mcap"
    file.add_metadata("arm", {"origin": "7"})
    file.messages(30)
    whole = file.content()
    tracemalloc.start()
    lies = (b"\xff\xff\xff\x7f", b"\xff\xff\xff\xff\xff\xff\xff\x7f", bytes(8))
    for place, lie in itertools.product(range(8, len(whole) - 8, 5), lies):
        path.write_bytes(whole[:place] + lie + whole[place + len(lie) :])
        with contextlib.suppress(UnreadableError), McapFile(path) as read:
            assert sum(1 for _ in read.messages()) <= 60
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 50 * MB
