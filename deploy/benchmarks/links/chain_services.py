"""The arm's own chain as it runs in the arm: the recipes and the wiring of its services."""

from __future__ import annotations

from deploy.benchmarks.link import KINEMATICS
from deploy.benchmarks.links import chain
from interfaces.service import ServiceNode
from services import kinematics, velocity


class Connection(chain.Connection):
    """A service in the middle; source and sink are those of the chain in callbacks."""

    def forward(self, source: str, target: str) -> None:
        node = ServiceNode(self.job.role)
        (kinematics if self.job.role == KINEMATICS else velocity).wire(node)
        self.executor.remove_node(self.node)
        self.node.destroy_node()
        self.node = node
        self.executor.add_node(node)
