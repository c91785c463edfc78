"""The wiring of a config publisher: it plays what the scenario says of its own value."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from interfaces.topics import DRIVEN_TIME, L1, THETA1, Topic
from reactive_node.testing import SpinFor, SpinUntil
from services.config_publisher import wire
from tests.component.wiring import Connect

SCENARIO = "l1: [{at: 0.0, value: 4.0}, {at: 0.2, value: 5.0}]\ntheta1: [{at: 0.0, value: 1.5}]\n"


@pytest.mark.parametrize(
    ("topic", "scenario", "values"),
    [
        (L1, SCENARIO, [4.0, 5.0]),
        (L1, f"{SCENARIO}drive: {{}}\n", [4.0, 5.0]),  # no drive moves a length
        (THETA1, SCENARIO, [1.5]),
        (THETA1, f"{SCENARIO}drive: {{}}\n", []),  # there is no driven time
        (THETA1, "l1: 4.0\ndrive: {}\n", [0.785398]),  # the parameter
    ],
)
def test_scenario_sets_the_value(
    connect: Connect,
    spin_until: SpinUntil,
    spin_for: SpinFor,
    tmp_path: Path,
    topic: Topic,
    scenario: str,
    values: list[float],
) -> None:
    (tmp_path / "scenario.yaml").write_text(scenario)
    publisher = connect(
        partial(wire, topic=topic),
        inputs=[DRIVEN_TIME],
        outputs=[topic],
        scenario=str(tmp_path / "scenario.yaml"),
        scenario_epoch=0.0,
    )
    heard = publisher.heard[topic.name]
    spin_until(lambda: [each.data for each in heard[-1:]] == values[-1:])
    spin_for(0.1)
    # The topic keeps its last value only: while the machine pauses, a newer one replaces it.
    assert [each.data for each in heard] in (values, values[-1:])
