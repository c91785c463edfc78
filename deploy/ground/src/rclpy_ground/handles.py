"""What the objects of the substitute have in common with those of the extension."""

from __future__ import annotations

import itertools

from rclpy_ground.genuine import InvalidHandle

_numbers = itertools.count(1)


class Destroyable:
    """An object that lives while it is used: ``with`` counts its uses."""

    pointer = 0
    """A number that no other object has."""

    def __init__(self) -> None:
        self.pointer = next(_numbers)
        self.is_wanted = True
        """Whether nobody has asked for its end."""
        self._uses = 0
        self._is_destroyed = False

    def __enter__(self) -> None:
        if not self.is_wanted:
            raise InvalidHandle("cannot use Destroyable because destruction was requested")
        self._uses += 1

    def __exit__(self, *_: object) -> None:
        self._uses -= 1
        if not self.is_wanted and not self._uses:
            self._end()

    def destroy_when_not_in_use(self) -> None:
        if self.is_wanted:
            self.is_wanted = False
            if not self._uses:
                self._end()

    def _end(self) -> None:
        if not self._is_destroyed:
            self._is_destroyed = True
            self.destroy()

    def destroy(self) -> None:
        """Free what it uses."""

    def __del__(self) -> None:
        if not self.__dict__.get("_is_destroyed", True):
            self._is_destroyed = True
            self.destroy()
