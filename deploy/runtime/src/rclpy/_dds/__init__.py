"""The part of DDS that the runtime stands on: participants, readers, writers and waiting, on Cyclone DDS."""

from .entities import (
    GuardCondition,
    Participant,
    Reader,
    Sample,
    WaitSet,
    Writer,
)
from .library import INFINITY, DDSError

__all__ = [
    "INFINITY",
    "DDSError",
    "GuardCondition",
    "Participant",
    "Reader",
    "Sample",
    "WaitSet",
    "Writer",
]
