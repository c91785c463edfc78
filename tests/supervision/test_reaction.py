"""How soon the engines stop, by the parameters of the services."""

from __future__ import annotations

from typing import Any

import pytest

from deploy.supervision import parameter_file
from deploy.supervision.processes import ROOT
from deploy.supervision.reaction import reaction


def of_watchdog(**parameters: Any) -> dict[str, dict[str, Any]]:
    return {"operator_watchdog": parameters}


def test_engines_of_the_thesis_stop_within_10_5_s() -> None:
    words = "Let go: engines off within 10.05 s, or 10.5 s if programs crash"
    assert reaction({}).words == words


def test_engines_of_quick_stop_within_1_86_s() -> None:
    found = parameter_file.reaction_to(parameter_file.load(str(ROOT / "deploy" / "quick.yaml"), "/"), "/")
    assert found.words == "Let go: engines off within 0.5 s, or 1.86 s if programs crash"


@pytest.mark.parametrize(
    ("given", "undisturbed", "one_death", "any_death"),
    [
        (of_watchdog(strikes=1), 4.05, 10.2, 10.5),
        (of_watchdog(strikes=1) | {"engine_controller": {"repeat": 0.2}}, 4.05, 10.3, 10.5),
        (of_watchdog(silence=1.0, sampling=0.25), 3.8, 10.2, 10.5),
        ({"engine_controller": {"presence_timeout": 5.0}}, 5.2, 5.5, 5.5),  # F2 acts before F1
        ({"velocity": {"strikes": 1}}, 10.05, 10.45, 10.5),
    ],
)
def test_bounds_follow_from_the_parameters(
    given: dict[str, dict[str, Any]], undisturbed: float, one_death: float, any_death: float
) -> None:
    found = reaction(given)
    assert (found.off_undisturbed, found.off_after_one_death, found.off_within) == (
        undisturbed,
        one_death,
        any_death,
    )


@pytest.mark.parametrize(
    "given",
    [
        {},  # the thesis
        of_watchdog(silence=1.55, strikes=1),  # max_presence_age is just short enough
        {"engine_controller": {"presence_timeout": 2.2}},
        of_watchdog(lifespan=0.1),
        of_watchdog(silence=1.0),
        of_watchdog(sampling=0.05, silence=0.2) | {"engine_controller": {"max_presence_age": 0.2}},
        {"engine_controller": {"max_presence_age": 0.7}},
        of_watchdog(sampling=0.4, silence=1.2) | {"dead_mans_switch": {"rate": 2.5}},
    ],
)
def test_parameters_that_allow_just_enough_time_are_taken(given: dict[str, dict[str, Any]]) -> None:
    reaction(given).check()
