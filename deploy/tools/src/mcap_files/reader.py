"""Reads every legal MCAP file, and what is whole in one without an end."""

from __future__ import annotations

import os
import struct
import tempfile
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, cast

import zstandard
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Channel, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

_ZSTD_MAGIC = struct.pack("<I", zstandard.MAGIC_NUMBER)  # no serialized message begins like this


class UnreadableError(Exception):
    """Why a file cannot be read; one line for the user."""


class McapFile:
    """An MCAP file that is being read; close it by `with`.

    A file may be compressed by zstd, and so may each of its messages, as rosbag2 does. Summary and indexes
    are used where they are complete. Otherwise, the file is read from its beginning.
    """

    def __init__(self, path: Path) -> None:
        """Read the contents. Raises UnreadableError if it is damaged or no MCAP file, and OSError."""
        self.path = path
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        """Of all messages, and others, by number."""
        self.counts: Counter[int] = Counter()
        """The numbers of messages by channel."""
        self.start = 0
        """The first log time [ns]; 0 without messages."""
        self.end = 0
        """The last log time [ns]."""
        self.metadata: list[Metadata] = []
        self.is_complete = True
        """Whether the file has an end: its writer has closed it."""
        self._file = path.open("rb")
        try:
            with self._errors():
                self._decompress()
                if self._file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                    raise UnreadableError(f"{path} is no MCAP file")
                self._has_index = self._read_summary()
                if not self._has_index:
                    self._scan()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> McapFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    @property
    def remark(self) -> str:
        """How much of a file without an end can be read, as one line; empty for a complete file."""
        if self.is_complete:
            return ""
        seconds = (self.end - self.start) / 1e9
        return f"{self.path} has no end: its {self.counts.total()} whole messages of {seconds:.1f} s are read"

    def type_name(self, channel: Channel) -> str:
        """Return the type of a channel's messages; empty if it has no schema."""
        return self.schemas[channel.schema_id].name if channel.schema_id else ""

    def messages(
        self, topics: Collection[str] | None = None, begin: int | None = None, end: int | None = None
    ) -> Iterator[tuple[Channel, Message]]:
        """Yield messages in the order of their log times; in a file without indexes, in the order of writing.

        :param topics: whose messages are yielded; ``None`` for all.
        :param begin, end: the first and the last log time [ns].
        :raises UnreadableError: if the file is damaged.
        """
        if begin is not None and end is not None and begin > end:
            return
        with self._errors():
            for channel, message in self._indexed(topics, begin, end) if self._has_index else self._written():
                if topics is not None and channel.topic not in topics:
                    continue
                if (begin is None or begin <= message.log_time) and (end is None or message.log_time <= end):
                    if message.data.startswith(_ZSTD_MAGIC):
                        message.data = _decompressed(message.data)
                    yield channel, message

    def _indexed(
        self, topics: Collection[str] | None, begin: int | None, end: int | None
    ) -> Iterator[tuple[Channel, Message]]:
        self._file.seek(0)
        reader = make_reader(self._file, validate_crcs=True)
        for _, channel, message in reader.iter_messages(topics, starting_at=begin, ending_at=end):
            yield channel, message

    def _written(self) -> Iterator[tuple[Channel, Message]]:
        for record in self._records():
            if isinstance(record, Message):
                yield self.channels[record.channel_id], record

    def _decompress(self) -> None:
        """Continue with a temporary copy if the file is compressed as a whole."""
        is_compressed = self._file.read(len(_ZSTD_MAGIC)) == _ZSTD_MAGIC
        self._file.seek(0)
        if is_compressed:
            with self._file as compressed:
                self._file = cast(Any, tempfile.TemporaryFile())  # noqa: SIM115 (the end of the `with` closes it)
                zstandard.ZstdDecompressor().copy_stream(compressed, self._file)
                self._file.seek(0)

    def _read_summary(self) -> bool:
        """Read the summary; return whether it is complete, and there are indexes."""
        try:
            self._file.seek(0)
            reader = make_reader(self._file)
            summary = reader.get_summary()
            if summary is None or not _is_complete(summary):
                return False
            metadata = list(reader.iter_metadata())
        except Exception:  # of any type, by the parser: the end is missing
            return False
        assert summary.statistics is not None
        self.schemas, self.channels, self.metadata = summary.schemas, summary.channels, metadata
        self.counts.update(summary.statistics.channel_message_counts)
        self.start, self.end = summary.statistics.message_start_time, summary.statistics.message_end_time
        return True

    def _scan(self) -> None:
        for record in self._records():
            if isinstance(record, Schema):
                self.schemas[record.id] = record
            elif isinstance(record, Channel):
                self.channels[record.id] = record
            elif isinstance(record, Metadata):
                self.metadata.append(record)
            elif isinstance(record, Message):
                self.start = min(self.start, record.log_time) if self.counts else record.log_time
                self.end = max(self.end, record.log_time)
                self.counts[record.channel_id] += 1

    def _records(self) -> Iterator[McapRecord]:
        """Yield the records of the data section, to the end or to the first that is not whole."""
        self._file.seek(0)
        whole = cast(IO[bytes], _Whole(self._file))
        try:
            yield from StreamReader(whole, validate_crcs=True).records
        except Exception:  # of any type, by the parser or a decompressor
            if _has_end(self._file):
                raise
            self.is_complete = False

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except (OSError, UnreadableError):
            raise
        except Exception as error:  # of any type, by the parser or a decompressor
            reason = " ".join(str(error).split()) or type(error).__name__
            raise UnreadableError(f"{self.path} is damaged: {reason}") from None


def is_cut(path: Path) -> bool:
    """Return whether a file has no end, by a look at its last bytes; not known of a compressed one.

    :raises OSError: if it cannot be read.
    """
    with path.open("rb") as file:
        return file.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC and not _has_end(file)


def _has_end(file: IO[bytes]) -> bool:
    file.seek(-len(MCAP0_MAGIC), os.SEEK_END)
    is_only_the_beginning = file.tell() == 0
    return file.read() == MCAP0_MAGIC and not is_only_the_beginning


def _is_complete(summary: Summary) -> bool:
    """Whether a summary has everything that is optional, so that the messages can be found with it."""
    statistics = summary.statistics
    if statistics is None or statistics.metadata_count != len(summary.metadata_indexes):
        return False
    used = statistics.channel_message_counts
    return (
        sum(used.values()) == statistics.message_count
        and used.keys() <= summary.channels.keys()
        and {channel.schema_id for channel in summary.channels.values()} <= {0, *summary.schemas}
        and statistics.chunk_count == len(summary.chunk_indexes)
        and (statistics.chunk_count > 0 or not statistics.message_count)
    )


def _decompressed(data: bytes) -> bytes:
    try:
        return zstandard.ZstdDecompressor().decompressobj().decompress(data)
    except zstandard.ZstdError:
        return data  # it is reported like any other message that cannot be read


class _Whole:
    """Reads as many bytes as it is asked for, or raises EndOfFile."""

    def __init__(self, file: IO[bytes]) -> None:
        self._read: Callable[[int], bytes] = file.read
        self._left = os.fstat(file.fileno()).st_size - file.tell()

    def read(self, length: int) -> bytes:
        self._left -= length
        if self._left < 0:  # a length that is damaged may be gigabytes
            raise EndOfFile
        return self._read(length)
