"""The octets of a large message without a copy of its long sequences."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typing import Self

LARGE = 65536
"""Octets from which a copy costs more than what avoids it."""


class Pieces:
    """The octets of a message. It grows like a bytearray, but does not copy long sequences."""

    __slots__ = ("_size", "pieces")

    def __init__(self, beginning: bytes | bytearray) -> None:
        self.pieces: list[bytearray | memoryview] = [bytearray(beginning)]
        self._size = len(beginning)

    def __iadd__(self, data: Any) -> Self:
        view = memoryview(data)
        if view.nbytes < LARGE or view.readonly:
            self.pieces[-1] += data
        else:
            self.pieces += view.cast("B"), bytearray()
        self._size += view.nbytes
        return self

    def __len__(self) -> int:
        return self._size

    def __bytes__(self) -> bytes:
        return b"".join(self.pieces)
