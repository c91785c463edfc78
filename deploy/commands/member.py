"""A node that joins the services: it sees their topics and sets their parameters."""

from __future__ import annotations

import os
import time
from datetime import UTC, datetime
from types import TracebackType

import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from deploy.security.rights import TERMINAL
from deploy.supervision import interruption, manifest
from deploy.supervision.environment import namespace_of
from deploy.supervision.errors import DeploymentError
from interfaces.service import UserError, enclave, middleware
from reactive_node import ReactiveNode
from reactive_node.executor import create_executor

SPIN_TIME = 0.01  # s


class Member:
    """In a `with`, this process takes part in the system's communication; it handles no signals."""

    def __init__(self, name: str = TERMINAL) -> None:
        """Join. Raises DeploymentError if the environment does not allow it.

        :param name: of the enclave, and with the pid of the node.
        """
        namespace = namespace_of(os.environ)
        self._keys = enclave.keys(enclave.path(name, namespace))
        try:
            arguments = enclave.arguments(name, namespace)
            with middleware.without_shared_memory():
                rclpy.init(
                    args=[*middleware.WITHOUT_LOG_FILES, *arguments],
                    signal_handler_options=SignalHandlerOptions.NO,
                )
                self.node = ReactiveNode(f"{name}_{os.getpid()}", namespace=namespace)
        except (RuntimeError, UserError) as error:
            rclpy.try_shutdown()
            raise DeploymentError(f"Cannot join the ROS graph: {error}") from None
        self._executor = create_executor()
        self._executor.add_node(self.node)

    def spin_once(self) -> None:
        """Run one callback; waits at most 0.1 s for it.

        :raises Interrupted: after a signal.
        :raises DeploymentError: when its keys have ended.
        """
        self._check()
        self._executor.spin_once(timeout_sec=0.1)

    def spin_some(self) -> None:
        """Run the callbacks of what has come, for ``SPIN_TIME``; raises as :meth:`spin_once`."""
        self._check()
        self._executor.spin_until_future_complete(Future(), timeout_sec=SPIN_TIME)

    def _check(self) -> None:
        interruption.check()
        if self._keys and (now := datetime.now(UTC)) >= self._keys.end:  # it hears nobody any longer
            raise DeploymentError(self._keys.problem(now))

    def set_everywhere(self, name: str, value: object, limit: float) -> None:
        """Set a parameter on all services that have it; wait at most `limit` [s] for their answers."""
        deadline = time.monotonic() + limit
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        waiting = [
            self.node.create_client(SetParameters, f"{program.name}/set_parameters")
            for program in manifest.programs()
        ]
        clients = list(waiting)
        answers: list[Future] = []
        while time.monotonic() < deadline and (waiting or not all(answer.done() for answer in answers)):
            ready = [client for client in waiting if client.service_is_ready()]
            answers += [client.call_async(request) for client in ready]
            waiting = [client for client in waiting if client not in ready]
            self.spin_once()
        for client in clients:
            self.node.destroy_client(client)

    def __enter__(self) -> Member:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown()
