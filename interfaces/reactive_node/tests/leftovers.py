"""What an action leaves behind each time: octets, Python's objects, files and threads."""

from __future__ import annotations

import ctypes
import gc
import itertools
import os
import sys
from collections.abc import Callable

TIMES = 200  # in a round
ROUNDS = 5
"""The best one counts: a table that doubles its size grows in one of them."""
_clear_caches = getattr(sys, "_clear_internal_caches", None) or sys._clear_type_cache
"""The cache of types keeps up to 4096 names (0.25 MB). rclpy makes a new name each time it reads a field."""
OCTETS, BLOCKS = 16.0, 0.5  # of one time: half of the smallest object


class _Heap(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_size_t)
        for name in (
            *("arena", "ordblks", "smblks", "hblks", "hblkhd"),
            *("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"),
        )
    ]


def _used() -> tuple[int, int, int]:
    """Return the octets of malloc, Python's blocks, and the number of files and threads."""
    _clear_caches()
    gc.collect()
    mallinfo = ctypes.CDLL(None).mallinfo2
    mallinfo.restype = _Heap
    heap = mallinfo()
    open_ones = sum(len(os.listdir(f"/proc/self/{kind}")) for kind in ("fd", "task"))
    return heap.uordblks + heap.hblkhd, sys.getallocatedblocks(), open_ones


def assert_nothing_is_left(
    action: Callable[[], object], rest: Callable[[], object], times: int = TIMES, limit: float = OCTETS
) -> None:
    """Call an action again and again: it leaves less than half an object behind each time.

    :param rest: returns when all is done that the last time has begun.
    :param limit: of the octets that are left each time.
    """
    used = []
    for _ in range(2 + ROUNDS):
        for _ in range(times):
            action()
        rest()
        used.append(_used())
    rounds = [[b - a for a, b in zip(*pair, strict=True)] for pair in itertools.pairwise(used)]
    octets, blocks, open_ones = map(min, zip(*rounds[1:], strict=True))  # the first ones fill caches
    assert octets / times < limit, f"{octets / times:.1f} octets are left each time: {rounds}"
    assert blocks / times < BLOCKS, f"{blocks / times:.2f} blocks are left each time"
    assert open_ones <= 0, f"{open_ones} files and threads are left of {times} times"
