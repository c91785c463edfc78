"""Unpacks what others have compressed, within a limit: a few kB may unpack to many GB."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import IO

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.records import Chunk

LARGEST = 256_000_000
"""Most bytes of a file that are in memory at a time: of a record, of the chunks that are read together."""
RATIO = 100
"""A file that is compressed as a whole may unpack to :data:`LARGEST`, or to so many times its size."""
_PIECE = 1_000_000  # bytes
_ZSTD_MAGIC = struct.pack("<I", zstandard.MAGIC_NUMBER)  # no serialized message begins like this


class LimitError(Exception):
    """A file needs more than a limit of its reader allows; one line for the user."""


def is_zstd(data: bytes) -> bool:
    return data.startswith(_ZSTD_MAGIC)


def megabytes(count: int) -> str:
    return f"{count // 1_000_000} MB"


def check(size: int, what: str) -> None:
    """Raise LimitError if so many bytes are too many for the memory."""
    if size > LARGEST:
        raise LimitError(f"{what} {megabytes(size)}, more than the limit of {megabytes(LARGEST)}")


def message(data: bytes) -> bytes:
    """Return the content of a compressed message. Raises LimitError, and ZstdError if it is damaged."""
    pieces, size = [], 0
    for piece in _pieces(data):
        size += len(piece)
        if size > LARGEST:
            raise LimitError(f"a message unpacks to more than the limit of {megabytes(LARGEST)}")
        pieces.append(piece)
    return b"".join(pieces)


def file(source: IO[bytes], size: int, target: IO[bytes]) -> None:
    """Unpack a file of so many bytes to another one. Raises LimitError, and ZstdError if it is damaged."""
    limit, written = max(LARGEST, RATIO * size), 0
    for piece in _pieces(source):
        written += len(piece)
        if written > limit:
            how = f"the limit of {megabytes(limit)}: unpack it yourself (zstd -d) if you trust it"
            raise LimitError(f"it unpacks to more than {how}")
        target.write(piece)


def chunk(packed: Chunk) -> bytes:
    """Return the records of a chunk.

    :raises LimitError: if it declares too many.
    :raises ValueError: if it contains another number of bytes than it declares.
    """
    size = packed.uncompressed_size
    check(size, "a chunk has")
    if packed.compression == "zstd":
        data = zstandard.ZstdDecompressor().stream_reader(packed.data).read(size + 1)
    elif packed.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(packed.data, size + 1)
    elif packed.compression:
        raise ValueError(f"its compression {packed.compression[:20]!r} is unknown")
    else:
        data = packed.data
    if len(data) != size:
        raise ValueError(f"a chunk has not the {size} bytes that it declares")
    return data


def _pieces(source: bytes | IO[bytes]) -> Iterator[bytes]:
    with zstandard.ZstdDecompressor().stream_reader(source, read_across_frames=True, closefd=False) as reader:
        while piece := reader.read(_PIECE):
            yield piece
