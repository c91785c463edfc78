"""A node of ours beside the services, with its executor: it listens to their health."""

from __future__ import annotations

import os
from types import TracebackType

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from deploy.supervision.system import DeploymentError, namespace_of
from interfaces.service.health import Health, HealthMonitor
from reactive_node import ReactiveNode


class Member:
    """In a `with`, this process takes part in the system's communication; it handles no signals."""

    def __init__(self) -> None:
        """Join. Raises DeploymentError if the environment does not let it."""
        try:
            rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
            self.node = ReactiveNode(f"console_{os.getpid()}", namespace=namespace_of(os.environ))
        except RuntimeError as error:
            rclpy.try_shutdown()
            raise DeploymentError(f"Cannot join the ROS graph: {error}") from None
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._monitor = HealthMonitor(self.node)

    @property
    def health(self) -> dict[str, Health]:
        """The latest health of each service, by program."""
        return self._monitor.latest

    def spin_once(self) -> None:
        """Run one callback; waits at most 0.1 s for it."""
        self._executor.spin_once(timeout_sec=0.1)

    def __enter__(self) -> Member:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown()
