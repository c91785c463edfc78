"""Two arms on one machine: each is hit in its turn, and neither notices the other."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from deploy.chaos.promises import CHECKERS
from interfaces.topics import ENGINES_STATE, ON

from .plays import Play

NAMESPACES = ("/arm1", "/arm2")
pytestmark = pytest.mark.timeout(120)


@pytest.fixture(scope="module")
def arms(light_plays: dict[str, Callable[..., Play]]) -> dict[str, Play]:
    """What became of each arm."""
    return {namespace: light_plays["fleet"](namespace) for namespace in NAMESPACES}


@pytest.mark.parametrize("namespace", NAMESPACES)
def test_each_arm_works_is_hit_and_keeps_its_promises(arms: dict[str, Play], namespace: str) -> None:
    play = arms[namespace]
    assert ON in {sample.value for sample in play.history.stream(ENGINES_STATE)}
    assert any(fault.kind in ("kill", "terminate") for fault in play.history.faults)
    for promise in CHECKERS:
        play.finding(promise)


def test_what_it_costs_and_how_it_ended_is_told(arms: dict[str, Play]) -> None:
    output = arms["/arm1"].output
    assert ") in 11 processes an arm" in output
    assert output.endswith("2 arms: no promise is broken\n")
