"""Texts that show the frames of a buffer: YAML, plain lines, Graphviz. Times are in nanoseconds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tf2_py._time_cache import StaticCache, TimeCache, seconds

_SHORTEST = 100_000
"""The transforms of a frame count as sent over at least 100 µs."""


def _known(
    frames: Mapping[str, TimeCache | StaticCache | None],
) -> Iterator[tuple[str, TimeCache | StaticCache, str]]:
    for frame, cache in frames.items():
        latest = None if cache is None else cache.at(0)
        if cache is not None and latest is not None:
            yield frame, cache, latest.parent


def _rate(cache: TimeCache | StaticCache) -> float:
    """Return the mean rate of the transforms [Hz]."""
    return len(cache) * 1e9 / max(cache.latest - cache.oldest, _SHORTEST)


def as_yaml(frames: Mapping[str, TimeCache | StaticCache | None], authorities: Mapping[str, str]) -> str:
    """Return the frames that have a parent, with statistics of their transforms."""
    if not frames:
        return "[]"
    return "".join(
        f"{frame}: \n"
        f"  parent: '{parent}'\n"
        f"  broadcaster: '{authorities[frame]}'\n"
        f"  rate: {_rate(cache):.3f}\n"
        f"  most_recent_transform: {seconds(cache.latest)}\n"
        f"  oldest_transform: {seconds(cache.oldest)}\n"
        f"  buffer_length: {(cache.latest - cache.oldest) / 1e9:.3f}\n"
        for frame, cache, parent in _known(frames)
    )


def as_string(frames: Mapping[str, TimeCache | StaticCache | None]) -> str:
    """Return the frames and their parents, a line for each."""
    lines = []
    for frame, cache in frames.items():
        if cache is not None:
            latest = cache.at(0)
            parent = "NO_PARENT" if latest is None else latest.parent
            lines.append(f"Frame {frame} exists with parent {parent}.\n")
    return "".join(lines)
