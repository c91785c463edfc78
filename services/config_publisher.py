"""Publishes one configuration value of the manipulator: a virtual source (thesis 5.2.1).

User story (ours): as a developer, I am able to set the manipulator's configuration by hand
(``ros2 param set /config_l1 value 2.5``) or by a scenario, and to give it back to the scenario
(``ros2 param set /config_l1 follow_scenario true``). ::

    python -m services.config_publisher l1
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

from interfaces import service
from interfaces.service import ServiceNode, parameter
from interfaces.service.epoch import Epoch
from interfaces.sources import driving
from interfaces.sources.player import Player
from interfaces.sources.settings import Settings
from interfaces.topics import CONFIGURATION, JOINTS, L1, L2, THETA1, THETA2, Topic


def _parameters(topic: Topic, default: float, within: tuple[float, float]) -> type:
    @dataclass(frozen=True)
    class Parameters:
        value: float = parameter(default, within, topic.unit, topic.meaning, settable=True)
        follow_scenario: bool = parameter(
            True, None, "", "whether the scenario sets the value; setting it by hand ends that", settable=True
        )

    return Parameters


Parameters = {
    L1.name: _parameters(L1, 2.0, (0.0, 1000.0)),
    L2.name: _parameters(L2, 3.0, (0.0, 1000.0)),
    THETA1.name: _parameters(THETA1, 0.785398, (-1000.0, 1000.0)),
    THETA2.name: _parameters(THETA2, 0.785398, (-1000.0, 1000.0)),
}
"""The parameters of each source; the defaults are the first values of Listing 5.9."""


def wire(node: ServiceNode, topic: Topic) -> None:
    """Publish the values of the parameter or the scenario."""
    node.declare(Parameters[topic.name])
    epoch = Epoch(node)
    player, settings = Player(node, epoch), Settings(node, is_restart=epoch.is_past)
    value = settings.keep("value", given_back="follow_scenario")
    timeline = player.scenario.configuration.get(topic.name)
    track = player.state(timeline)
    if timeline and topic in JOINTS and player.scenario.drive:
        track = driving.track(node, timeline)
    node.publish(topic, value.instead_of(track))


if __name__ == "__main__":
    source = sys.argv[1] if len(sys.argv) > 1 else ""
    if source not in CONFIGURATION:
        sources = ", ".join(CONFIGURATION)
        service.refuse("config_publisher", f"the source must be one of {sources}, not {source!r}")
    service.run(f"config_{source}", lambda node: wire(node, CONFIGURATION[source]))
