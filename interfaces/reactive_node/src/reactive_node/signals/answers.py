"""What a signal answers: a value, the time for which it holds, and how much is known about it."""

from __future__ import annotations

from typing import Any, Generic, NamedTuple, TypeVar

T = TypeVar("T")

CERTAIN, HELD, EXTRAPOLATED, UNKNOWN = range(4)
"""
The marks of an answer: it follows from samples on both sides, or from the silence of a state; it is the last
value although newer ones are missing; it continues the last movement; there is none.
"""


class Answer(NamedTuple, Generic[T]):
    """The value of a signal at a time."""

    time: int
    """[ns]."""
    value: T
    """``None`` if it is unknown."""
    mark: int = CERTAIN
    """The weakest mark of all that the value was made from."""

    @property
    def is_certain(self) -> bool:
        """Whether samples that come later would not change the value."""
        return self.mark == CERTAIN


class Refused(NamedTuple):
    """A sample that a signal did not take as it came, because it was outside of the bounds of its time."""

    time: int
    """The time of the sample [ns]."""
    value: Any
    reason: str
    """For a person."""
    taken: int | None = None
    """The time from which its value holds instead [ns]; ``None`` if it was dropped."""
    is_first: bool = False
    """
    Whether it was the first to arrive, or comes right after that one. A late reader gets the last value of a
    state, however old it is.
    """
