"""One parameter of the manipulator: a virtual source (thesis 5.2.1).

User story (ours): as a developer, I am able to give the manipulator any configuration, by hand
(``ros2 param set /config_l1 value 2.5``) or along a scenario. ::

    python -m services.config_publisher l1
"""

from __future__ import annotations

import sys

from interfaces import service
from interfaces.service import ServiceNode
from interfaces.topics import CONFIGURATION, L1, L2, Topic

DEFAULTS = {"l1": 2.0, "l2": 3.0, "theta1": 0.785398, "theta2": 0.785398}
"""As Listing 5.9 begins."""


def wire(node: ServiceNode, topic: Topic) -> None:
    """Connect parameter and scenario with the topic."""
    within = (0.0, 1000.0) if topic in (L1, L2) else (-1000.0, 1000.0)
    node.declare("value", DEFAULTS[topic.name], within, f"{topic.meaning} [{topic.unit}]", settable=True)
    timeline = node.declare_scenario().configuration.get(topic.name)
    values = node.follow("value", node.play(timeline))
    node.publish(topic, values.map(lambda value: topic.type(data=value)))


def main() -> None:
    """Run the service of the source that the first argument names."""
    source = sys.argv[1] if len(sys.argv) > 1 else ""
    if source not in CONFIGURATION:
        service.refuse(
            "config_publisher", f"the source must be one of {', '.join(CONFIGURATION)}, not {source!r}"
        )
    service.run(f"config_{source}", lambda node: wire(node, CONFIGURATION[source]))


if __name__ == "__main__":
    main()
