"""Plays that are no burden to the machine, and so are played at the same time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from deploy.chaos.partition import missing

from .plays import Play, playing

FLEET = ("--arms", "2", "--minutes", "0.3", "--every", "4", "--faults", "kill,terminate", "--seed", "1")


@pytest.fixture(scope="session")
def light_plays(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Callable[..., Play]]]:
    """The partition, where this machine can have one, and a fleet of two; each waits for its end."""
    options = {"fleet": FLEET} if missing() else {"fleet": FLEET, "partition": ("--scenario", "partition")}
    with ExitStack() as stack:
        yield {
            name: stack.enter_context(playing(tmp_path_factory.mktemp(name), *given))
            for name, given in options.items()
        }
