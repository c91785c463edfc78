"""The search for a path of transforms between two frames. Times are in nanoseconds."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from typing import NamedTuple, TypeAlias

import numpy as np

from tf2_py import _frame_graph
from tf2_py._exceptions import ConnectivityException, ExtrapolationException, LookupException
from tf2_py._matrices import IDENTITY, Matrix, inverse
from tf2_py._time_cache import Interpolation, Sample, StaticCache, TimeCache

Frames: TypeAlias = Mapping[str, TimeCache | StaticCache | None]
"""The transforms of each frame to its parent, ``None`` for a frame without a parent."""
Link: TypeAlias = Sample | Interpolation


class Path(NamedTuple):
    """The links from two frames up to the nearest frame above both, by frame, lowest first."""

    from_source: dict[str, Link]
    from_target: dict[str, Link]
    common: str

    @property
    def matrix(self) -> Matrix:
        """The transform from the source to the target."""
        source = _compose(self.from_source)
        return inverse(_compose(self.from_target)) @ source if self.from_target else source

    @property
    def frames(self) -> list[str]:
        return [*self.from_source, self.common, *reversed(self.from_target)]

    @property
    def latest_common_time(self) -> int:
        """The earliest of the links' times, static ones apart; 0 if all are static."""
        links = (*self.from_source.values(), *self.from_target.values())
        return min((link.stamp for link in links if link.stamp), default=0)


def _compose(links: dict[str, Link]) -> Matrix:
    """Return the transform from the lowest frame to the parent of the highest one."""
    return reduce(np.matmul, (link.matrix for link in reversed(links.values()))) if links else IDENTITY


def find_path(frames: Frames, target: str, source: str, stamp: int) -> Path:
    """Find the path between two frames at a time, or through the latest transforms if it is 0.

    :raises ConnectivityException: if nothing connects the frames.
    :raises ExtrapolationException: if a transform that would connect them is not known at that time.
    :raises LookupException: if the frames form a loop.
    """
    from_source: dict[str, Link] = {}
    from_target: dict[str, Link] = {}
    failure: ExtrapolationException | None = None
    frame = source
    while frame != target:
        try:
            link = _link(frames, frame, stamp)
        except ExtrapolationException as error:
            failure = error  # the target may still be below this frame
            break
        if link is None:
            break
        from_source[frame] = link
        frame = link.parent
        if frame in from_source:
            raise _loop(frames)
    top, frame = frame, target
    while frame != top and frame not in from_source:
        try:
            link = _link(frames, frame, stamp)
        except ExtrapolationException as error:
            failure, link = error, None
        if link is None:
            if failure is not None:
                raise ExtrapolationException(
                    f"{failure}, when looking up transform from frame [{source}] to frame [{target}]"
                ) from None
            raise ConnectivityException(
                f"Could not find a connection between '{target}' and '{source}' because they are not part of"
                " the same tree.Tf has two or more unconnected trees."
            )
        from_target[frame] = link
        frame = link.parent
        if frame in from_target:
            raise _loop(frames)
    if frame in from_source:
        below = list(from_source).index(frame)
        from_source = dict(list(from_source.items())[:below])
    return Path(from_source, from_target, frame)


def latest_common_time(frames: Frames, target: str, source: str) -> int:
    """Return the latest time at which the path between two frames is known; see :func:`find_path`."""
    if target == source:
        cache = frames.get(target)
        return 0 if cache is None else cache.latest
    return find_path(frames, target, source, 0).latest_common_time


def _link(frames: Frames, frame: str, stamp: int) -> Link | None:
    """Return the transform from a frame to its parent, ``None`` at the top of a tree."""
    cache = frames.get(frame)
    return None if cache is None else cache.at(stamp)


def _loop(frames: Frames) -> LookupException:
    return LookupException(
        f"The tf tree is invalid because it contains a loop.\n{_frame_graph.as_string(frames)}\n"
    )
