"""The layouts for Foxglove and RViz show topics and frames that exist."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from interfaces import robot_model, topics
from tests.promises.observations import FAULTS

VIEWS = Path(__file__).parents[2] / "deploy" / "views"
TOPICS = {f"/{topic.name.lstrip('/')}": topic for topic in topics.CONTRACT}
FOXGLOVE = json.loads((VIEWS / "foxglove.json").read_text())
PANELS = FOXGLOVE["configById"]


def shown(layout: Any) -> Iterator[str]:
    if isinstance(layout, str):
        yield layout
    else:
        yield from shown(layout["first"])
        yield from shown(layout["second"])


def paths() -> list[tuple[str, str]]:
    given = [path["value"] for panel in PANELS.values() for path in panel.get("paths", ())]
    return [(topic, field) for topic, _, field in (value.rpartition(".") for value in given)]


def test_each_panel_is_shown_once() -> None:
    assert sorted(shown(FOXGLOVE["layout"])) == sorted(PANELS)
    kinds = {name.partition("!")[0] for name in PANELS}
    assert kinds == {"3D", "Plot", "StateTransitions", "DiagnosticSummary"}


def test_plotted_values_are_fields_of_the_contract() -> None:
    assert len(paths()) == 6
    for topic, field in paths():
        if topic != FAULTS:  # of chaos records
            assert field in TOPICS[topic].type.get_fields_and_field_types()


def test_3d_panel_shows_the_model_in_the_frame_of_the_arm() -> None:
    panel = PANELS["3D!arm"]
    assert panel["followTf"] == robot_model.BASE
    assert panel["topics"].keys() <= TOPICS.keys()
    assert panel["topics"][f"/{topics.ROBOT_DESCRIPTION.name}"] == {"visible": True}


def test_diagnostics_panel_shows_the_health_of_the_services() -> None:
    assert PANELS["DiagnosticSummary!processes"]["topicToRender"] == topics.DIAGNOSTICS.name


def test_rviz_shows_the_model_in_the_frame_of_the_arm() -> None:
    settings = yaml.safe_load((VIEWS / "arm.rviz").read_text())
    window = settings["Window Geometry"]
    assert {"Hide Left Dock", "Hide Right Dock"} <= window.keys(), "RViz takes random values for absent ones"
    view = settings["Visualization Manager"]
    shown = [each["Name"] for each in view["Displays"]]
    assert shown == ["Grid", "RobotModel"], "a TF display warns about the frames of other arms on /tf"
    assert view["Global Options"]["Fixed Frame"] == robot_model.BASE
    model = next(each for each in view["Displays"] if each["Name"] == "RobotModel")
    assert model["Description Topic"]["Value"] == topics.ROBOT_DESCRIPTION.name
    assert model["Description Topic"]["Durability Policy"] == "Transient Local"
