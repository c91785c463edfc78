"""The arm's own chain and watchdog as they run in the arm: the recipes and the wiring of its services."""

from __future__ import annotations

from collections.abc import Callable

from interfaces.service import ServiceNode
from reactive_node.executor import create_executor
from services import kinematics, operator_watchdog, velocity
from tests.benchmarks.link import KINEMATICS, VELOCITY, WATCHDOG
from tests.benchmarks.links import chain

_SERVICES = {KINEMATICS: kinematics, VELOCITY: velocity, WATCHDOG: operator_watchdog}


class Connection(chain.Connection):
    """A service in the middle; source and sink are those of the chain in callbacks."""

    make_service: Callable[[str], ServiceNode] = ServiceNode
    make_executor = staticmethod(create_executor)

    def forward(self, source: str, target: str) -> None:
        node = type(self).make_service(self.job.role)
        _SERVICES[self.job.role].wire(node)
        self.executor.remove_node(self.node)
        self.node.destroy_node()
        self.node = node
        self.executor.add_node(node)
