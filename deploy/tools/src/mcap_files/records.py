"""Walks through the records of an MCAP file, one after another, and through those of its chunks.

Lengths in a file may lie: nothing is read that is not there, and nothing that is larger than the limit. What
the reader does not need is not parsed.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from itertools import pairwise
from typing import IO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, McapRecord, Message, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from mcap_files import unpacking

_HEAD = struct.Struct("<BQ")  # opcode and length
HEAD = _HEAD.size
"""Bytes of a record before its content."""
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_PIECE = 1_000_000  # bytes
_PARSED = {each.value: each.name.lower() for each in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)} | {
    each.value: each.name.lower() for each in (Opcode.CHUNK, Opcode.METADATA, Opcode.DATA_END)
}


def of_file(file: IO[bytes]) -> Iterator[McapRecord]:
    """Yield schemas, channels, messages and metadata of a whole file, in the order of writing.

    :raises EndOfFile: if the file ends within a record, or without its end.
    :raises LimitError: if a record is too large.
    """
    file.seek(len(MCAP0_MAGIC))
    left = os.fstat(file.fileno()).st_size - len(MCAP0_MAGIC)
    checksum = zlib.crc32(MCAP0_MAGIC)
    while True:
        head = file.read(_HEAD.size)
        if len(head) < _HEAD.size:
            raise EndOfFile
        opcode, length = _HEAD.unpack(head)
        left -= _HEAD.size + length
        if left < 0:  # a length that is damaged may be gigabytes
            raise EndOfFile
        if opcode not in _PARSED:
            if not opcode:
                raise ValueError("a record has no kind")
            checksum = zlib.crc32(head, checksum)
            for begin in range(0, length, _PIECE):
                checksum = zlib.crc32(file.read(min(_PIECE, length - begin)), checksum)
            if opcode == Opcode.FOOTER:
                break
            continue
        unpacking.check(length, f"a {_PARSED[opcode]} has")
        content = file.read(length)
        if opcode == Opcode.DATA_END:
            if DataEnd.read(ReadDataStream(BytesIO(content))).data_section_crc not in (0, checksum):
                raise ValueError("the checksum of its data is wrong")
        elif opcode == Opcode.CHUNK:
            yield from of_chunk(unpacked(content))
        elif record := _parsed(opcode, memoryview(content)):
            yield record
        checksum = zlib.crc32(content, zlib.crc32(head, checksum))
    if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        raise EndOfFile


def unpacked(content: bytes) -> bytes:
    """Return the records of a chunk. Raises ValueError if it is damaged, LimitError if it is too large."""
    chunk = Chunk.read(ReadDataStream(BytesIO(content)))
    data = unpacking.chunk(chunk)
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError("the checksum of a chunk is wrong")
    return data


def at(file: IO[bytes], offset: int, length: int, kind: Opcode) -> bytes:
    """Return the content of the record of a kind and a length that an index refers to.

    :raises ValueError: if there is another one.
    :raises LimitError: if it is too large.
    """
    unpacking.check(length, f"a {_PARSED[kind]} has")
    file.seek(offset)
    if file.read(_HEAD.size) != _HEAD.pack(kind, length - _HEAD.size):
        raise ValueError("its index is wrong")
    return file.read(length - _HEAD.size)


def of_chunk(data: bytes) -> Iterator[McapRecord]:
    """Yield schemas, channels and messages of an unpacked chunk."""
    for opcode, begin, end in _extents(data):
        if opcode in _PARSED and (record := _parsed(opcode, memoryview(data)[begin:end])):
            yield record


def in_order(data: bytes) -> Iterator[Message]:
    """Yield the messages of an unpacked chunk in the order of their log times."""

    def begins() -> Iterator[int]:
        return (begin for opcode, begin, _ in _extents(data) if opcode == Opcode.MESSAGE)

    def log_time(begin: int) -> int:
        time: int = _MESSAGE.unpack_from(data, begin)[2]
        return time

    is_ordered = all(one <= other for one, other in pairwise(map(log_time, begins())))
    for begin in begins() if is_ordered else sorted(begins(), key=log_time):
        _, length = _HEAD.unpack_from(data, begin - _HEAD.size)
        yield _message(memoryview(data)[begin : begin + length])


def _extents(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, begin and end of each record."""
    end = 0
    while end < len(data):
        opcode, length = _HEAD.unpack_from(data, end)
        begin = end + _HEAD.size
        end = begin + length
        if end > len(data):
            raise ValueError("a record is longer than its chunk")
        yield opcode, begin, end


def _parsed(opcode: int, content: memoryview) -> McapRecord | None:
    if opcode == Opcode.MESSAGE:
        return _message(content)
    for kind, parse in ((Opcode.SCHEMA, Schema), (Opcode.CHANNEL, Channel), (Opcode.METADATA, Metadata)):
        if opcode == kind:
            record: McapRecord = parse.read(ReadDataStream(BytesIO(content)))
            return record
    return None


def _message(content: memoryview) -> Message:
    channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(content)
    return Message(channel, log_time, bytes(content[_MESSAGE.size :]), publish_time, sequence)
