"""Reads every legal MCAP file, and what is whole in one without an end."""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from heapq import heappop, heappush
from io import BytesIO
from itertools import islice, pairwise
from pathlib import Path
from typing import IO, Any, cast

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import FOOTER_SIZE
from mcap.records import (
    Channel,
    ChunkIndex,
    Footer,
    McapRecord,
    Message,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from mcap_files import records, unpacking
from mcap_files.unpacking import LimitError, megabytes

KEPT = 1_000_000_000
"""Most bytes that the messages of a file take in the memory of a program that keeps them all."""
_OBJECT = 300  # bytes of memory that a record takes beside its content, measured
_LARGEST_SUMMARY = 64_000_000  # bytes; ten times as many in memory


class UnreadableError(RuntimeError):
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
                self._summary = self._read_summary()
                if self._summary is None:
                    self._scan()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> McapFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    @property
    def is_indexed(self) -> bool:
        """Whether its messages are yielded in the order of their log times."""
        return self._summary is not None

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
            for channel, message in self._indexed(topics, begin, end) if self._summary else self._written():
                if topics is not None and channel.topic not in topics:
                    continue
                if (begin is None or begin <= message.log_time) and (end is None or message.log_time <= end):
                    if unpacking.is_zstd(message.data):
                        message.data = _unpacked(message.data)
                    yield channel, message

    def kept(self, topics: Collection[str]) -> Iterator[tuple[Channel, Message]]:
        """Yield messages as :meth:`messages` does, for a program that keeps them all.

        :raises UnreadableError: if they need more memory than :data:`KEPT`, or the file declares that.
        """
        counts = [self.counts[number] for number, each in self.channels.items() if each.topic in topics]
        with self._errors():
            _check_kept(sum(counts) * _OBJECT)
            size = 0
            for channel, message in self.messages(topics):
                size += len(message.data) + _OBJECT
                _check_kept(size)
                yield channel, message

    def _indexed(
        self, topics: Collection[str] | None, begin: int | None, end: int | None
    ) -> Iterator[tuple[Channel, Message]]:
        """Yield the messages of chunks that may overlap, and some others of the same chunks."""
        assert self._summary is not None
        numbers = {id for id, each in self.channels.items() if topics is None or each.topic in topics}
        wanted = [each for each in self._summary.chunk_indexes if _may_have(each, numbers, begin, end)]
        following = sorted(wanted, key=lambda each: (each.message_start_time, each.chunk_start_offset))
        following.reverse()
        held = 0  # bytes
        opened: list[tuple[int, int, Message, Iterator[Message], int]] = []  # a heap: the next of each chunk
        while following or opened:
            if following and (not opened or following[-1].message_start_time <= opened[0][0]):
                index = following.pop()
                offset = index.chunk_start_offset
                data = records.unpacked(records.at(self._file, offset, index.chunk_length, Opcode.CHUNK))
                size, rest = len(data), records.in_order(data)
                held += size
                unpacking.check(held, "the chunks of one time have")
            else:
                _, offset, message, rest, size = heappop(opened)
                yield self.channels[message.channel_id], message
            if first := next(rest, None):
                heappush(opened, (first.log_time, offset, first, rest, size))
            else:
                held -= size

    def _written(self) -> Iterator[tuple[Channel, Message]]:
        """Yield the messages that the file had when it was opened: a recorder may add others meanwhile."""
        written = (record for record in self._records() if isinstance(record, Message))
        for message in islice(written, self.counts.total()):
            yield self.channels[message.channel_id], message

    def _decompress(self) -> None:
        """Continue with a temporary copy if the file is compressed as a whole."""
        is_compressed = unpacking.is_zstd(self._file.read(len(MCAP0_MAGIC)))
        self._file.seek(0)
        if is_compressed:
            with self._file as compressed:
                self._file = cast(Any, tempfile.TemporaryFile())  # noqa: SIM115 (the end of the `with` closes it)
                unpacking.file(compressed, self.path.stat().st_size, self._file)
                self._file.seek(0)

    def _read_summary(self) -> Summary | None:
        """Read the summary; return it if it is complete, and there are indexes."""
        try:
            end = self._file.seek(-(FOOTER_SIZE + len(MCAP0_MAGIC)), os.SEEK_END)
            footer = Footer.read(ReadDataStream(BytesIO(self._file.read()[records.HEAD :])))
            if not footer.summary_start or end - footer.summary_start > _LARGEST_SUMMARY:
                return None
            self._file.seek(footer.summary_start)
            summary = _parsed(self._file.read())
            if not _is_complete(summary, end):
                return None
            metadata = [
                Metadata.read(
                    ReadDataStream(BytesIO(records.at(self._file, it.offset, it.length, Opcode.METADATA)))
                )
                for it in summary.metadata_indexes
            ]
        except Exception:  # of any type, by the parser: the end is missing
            return None
        assert summary.statistics is not None
        self.schemas, self.channels, self.metadata = summary.schemas, summary.channels, metadata
        self.counts.update(summary.statistics.channel_message_counts)
        self.start, self.end = summary.statistics.message_start_time, summary.statistics.message_end_time
        return summary

    def _scan(self) -> None:
        size = 0  # bytes of what is kept
        for record in self._records():
            if isinstance(record, Message):
                self.start = min(self.start, record.log_time) if self.counts else record.log_time
                self.end = max(self.end, record.log_time)
                self.counts[record.channel_id] += 1
                continue
            if isinstance(record, Metadata):
                self.metadata.append(record)
            elif isinstance(record, Schema) and self.schemas.get(record.id) != record:
                self.schemas[record.id] = record
            elif isinstance(record, Channel) and self.channels.get(record.id) != record:
                self.channels[record.id] = record
            else:
                continue
            size += _size(record)
            unpacking.check(size, "its schemas, channels and metadata have")

    def _records(self) -> Iterator[McapRecord]:
        """Yield the records of the data section, to the end or to the first that is not whole."""
        try:
            yield from records.of_file(self._file)
        except (LimitError, MemoryError, OSError):
            raise
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
        except LimitError as error:
            raise UnreadableError(f"{self.path} is not read: {error}") from None
        except MemoryError:
            raise UnreadableError(f"{self.path} is not read: this process has no memory for it") from None
        except Exception as error:  # of any type, by the parser or a decompressor
            reason = " ".join(str(error).split()) or type(error).__name__
            raise UnreadableError(f"{self.path} is damaged: {reason}") from None


def _has_end(file: IO[bytes]) -> bool:
    file.seek(-len(MCAP0_MAGIC), os.SEEK_END)
    is_only_the_beginning = file.tell() == 0
    return file.read() == MCAP0_MAGIC and not is_only_the_beginning


def _parsed(data: bytes) -> Summary:
    """Return the summary in the last bytes of a file. Raises an exception of any type if it is damaged."""
    summary = Summary()
    for record in StreamReader(BytesIO(data), skip_magic=True, emit_chunks=True).records:
        match record:
            case Schema():
                summary.schemas[record.id] = record
            case Channel():
                summary.channels[record.id] = record
            case Statistics():
                summary.statistics = record
            case ChunkIndex():
                summary.chunk_indexes.append(record)
            case MetadataIndex():
                summary.metadata_indexes.append(record)
    return summary


def _is_complete(summary: Summary, end: int) -> bool:
    """Whether a summary has everything that is optional, so that the messages can be found with it.

    :param end: where the file ends before its footer.
    """
    statistics = summary.statistics
    if statistics is None or statistics.metadata_count != len(summary.metadata_indexes):
        return False
    used = statistics.channel_message_counts
    places = [(each.offset, each.length) for each in summary.metadata_indexes]
    places += [(each.chunk_start_offset, each.chunk_length) for each in summary.chunk_indexes]
    ends = pairwise([*sorted(places), (end, 0)])
    return (
        sum(used.values()) == statistics.message_count
        and used.keys() <= summary.channels.keys()
        and {channel.schema_id for channel in summary.channels.values()} <= {0, *summary.schemas}
        and statistics.chunk_count == len(summary.chunk_indexes)
        and (statistics.chunk_count > 0 or not statistics.message_count)
        and all(begin + length <= following for (begin, length), (following, _) in ends)  # nothing is twice
    )


def _may_have(index: ChunkIndex, numbers: set[int], begin: int | None, end: int | None) -> bool:
    """Whether a chunk may have messages of these channels from the time ``begin`` to ``end`` [ns]."""
    is_early = begin is not None and index.message_end_time < begin
    is_late = end is not None and index.message_start_time > end
    known = index.message_index_offsets
    return not (is_early or is_late) and not (known and numbers.isdisjoint(known))


def _size(record: Schema | Channel | Metadata) -> int:
    """Return how many bytes of memory a record takes."""
    values = list(vars(record).values())
    values += [text for pairs in values if isinstance(pairs, dict) for pair in pairs.items() for text in pair]
    return _OBJECT + sum(len(value) for value in values if isinstance(value, bytes | str))


def _check_kept(size: int) -> None:
    if size > KEPT:
        raise LimitError(f"its messages need more memory than the limit of {megabytes(KEPT)}")


def _unpacked(data: bytes) -> bytes:
    try:
        return unpacking.message(data)
    except zstandard.ZstdError:
        return data  # it is reported like any other message that cannot be read
