"""Hashes of type definitions (REP 2011)."""

from __future__ import annotations

_SIZE = 32


class TypeHash:
    """A type hash: the RIHS version (-1: the hash is unknown) and 32 bytes."""

    _TYPE_HASH_SIZE = _SIZE

    __slots__ = ("_value", "_version")

    # Not hashable, because it is mutable, as in rclpy.
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, version: int = -1, value: bytes = bytes(_SIZE)) -> None:
        self.version = version
        self.value = value

    @property
    def version(self) -> int:
        return self._version

    @version.setter
    def version(self, value: int) -> None:
        assert isinstance(value, int), f"version must be an int, not {value!r}"
        self._version = value

    @property
    def value(self) -> bytes:
        return self._value

    @value.setter
    def value(self, value: bytes) -> None:
        assert isinstance(value, bytes), f"value must be bytes, not {value!r}"
        self._value = value

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, TypeHash):
            return False
        return self._version == other._version and self._value == other._value

    def __str__(self) -> str:
        if self._version <= 0 or len(self._value) != _SIZE:
            return "INVALID"
        return f"RIHS{self._version:02}_{self._value.hex()}"

    @classmethod
    def _rclpy_parse(cls, text: str) -> TypeHash:
        """Parse the result of `str`; for other texts, return the unknown hash."""
        version, separator, value = text.removeprefix("RIHS").partition("_")
        if not (text.startswith("RIHS") and separator and version.isdecimal() and len(value) == 2 * _SIZE):
            return cls()
        try:
            return cls(int(version), bytes.fromhex(value))
        except ValueError:
            return cls()
