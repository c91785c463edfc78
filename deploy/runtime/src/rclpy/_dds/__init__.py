"""Participants, readers, writers and wait sets of DDS, implemented with Cyclone DDS."""

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
