"""ROS 2 topics, parameters, QoS events, services and actions as ReactiveX observables."""

from reactive_node.backpressure import latest
from reactive_node.node import ReactiveNode
from reactive_node.scheduler import NodeScheduler
from reactive_node.stamps import Timestamp

__all__ = ["NodeScheduler", "ReactiveNode", "Timestamp", "latest"]
