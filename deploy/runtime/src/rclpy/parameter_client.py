"""A client for the parameters of another node."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter, parameter_dict_from_yaml_file
from rclpy.qos import QoSProfile, qos_profile_parameter_events, qos_profile_services_default

if TYPE_CHECKING:
    from rclpy.callback_groups import CallbackGroup
    from rclpy.client import Client
    from rclpy.event_handler import SubscriptionEventCallbacks
    from rclpy.node import Node
    from rclpy.qos_overriding_options import QoSOverridingOptions
    from rclpy.subscription import Subscription
    from rclpy.task import Future


class AsyncParameterClient:
    """Calls the parameter services of another node; `callback` is a done callback of the returned future."""

    def __init__(
        self,
        node: Node,
        remote_node_name: str,
        qos_profile: QoSProfile = qos_profile_services_default,
        callback_group: CallbackGroup | None = None,
    ) -> None:
        """Create the clients; they belong to `node`."""
        self.remote_node_name = remote_node_name
        self.node = node

        def create(service_type: Any, name: str) -> Client:
            return node.create_client(
                service_type,
                f"{remote_node_name}/{name}",
                qos_profile=qos_profile,
                callback_group=callback_group,
            )

        self._get_parameter_client = create(GetParameters, "get_parameters")
        self._list_parameter_client = create(ListParameters, "list_parameters")
        self._set_parameter_client = create(SetParameters, "set_parameters")
        self._get_parameter_types_client = create(GetParameterTypes, "get_parameter_types")
        self._describe_parameters_client = create(DescribeParameters, "describe_parameters")
        self._set_parameters_atomically_client = create(SetParametersAtomically, "set_parameters_atomically")

    def _rclpy_clients(self) -> list[Client]:
        return [
            self._get_parameter_client,
            self._list_parameter_client,
            self._set_parameter_client,
            self._get_parameter_types_client,
            self._describe_parameters_client,
            self._set_parameters_atomically_client,
        ]

    def services_are_ready(self) -> bool:
        return all(client.service_is_ready() for client in self._rclpy_clients())

    def wait_for_services(self, timeout_sec: float | None = None) -> bool:
        """Return whether all services are available within `timeout_sec` seconds (`None`: no limit)."""
        deadline = None if timeout_sec is None else time.monotonic() + timeout_sec
        for client in self._rclpy_clients():
            remaining = None if deadline is None else deadline - time.monotonic()
            if not client.wait_for_service(timeout_sec=remaining):
                return False
        return self.services_are_ready()

    def list_parameters(
        self,
        prefixes: list[str] | None = None,
        depth: int | None = None,
        callback: Callable[[Future], Any] | None = None,
    ) -> Future:
        """Request the names below `prefixes`, `depth` levels deep; by default all."""
        request = ListParameters.Request(prefixes=prefixes or [], depth=depth or 0)
        return _call(self._list_parameter_client, request, callback)

    def get_parameters(self, names: list[str], callback: Callable[[Future], Any] | None = None) -> Future:
        return _call(self._get_parameter_client, GetParameters.Request(names=names), callback)

    def set_parameters(
        self,
        parameters: Sequence[Parameter | ParameterMsg],
        callback: Callable[[Future], Any] | None = None,
    ) -> Future:
        """Set parameters one by one."""
        request = SetParameters.Request(parameters=_messages(parameters))
        return _call(self._set_parameter_client, request, callback)

    def describe_parameters(
        self, names: list[str], callback: Callable[[Future], Any] | None = None
    ) -> Future:
        return _call(self._describe_parameters_client, DescribeParameters.Request(names=names), callback)

    def get_parameter_types(
        self, names: list[str], callback: Callable[[Future], Any] | None = None
    ) -> Future:
        return _call(self._get_parameter_types_client, GetParameterTypes.Request(names=names), callback)

    def set_parameters_atomically(
        self,
        parameters: Sequence[Parameter | ParameterMsg],
        callback: Callable[[Future], Any] | None = None,
    ) -> Future:
        """Set all parameters or none."""
        request = SetParametersAtomically.Request(parameters=_messages(parameters))
        return _call(self._set_parameters_atomically_client, request, callback)

    def delete_parameters(self, names: list[str], callback: Callable[[Future], Any] | None = None) -> Future:
        """Undeclare parameters, which must be dynamically typed."""
        return self.set_parameters([Parameter(name) for name in names], callback)

    def load_parameter_file(
        self,
        parameter_file: str,
        use_wildcard: bool = False,
        callback: Callable[[Future], Any] | None = None,
    ) -> Future:
        """Set the parameters of a YAML file one by one. Raises RuntimeError if it is not a parameter file."""
        parameters = parameter_dict_from_yaml_file(parameter_file, use_wildcard)
        return self.set_parameters(list(parameters.values()), callback)

    def load_parameter_file_atomically(
        self,
        parameter_file: str,
        use_wildcard: bool = False,
        callback: Callable[[Future], Any] | None = None,
    ) -> Future:
        """Set all parameters of a YAML file or none. Raises RuntimeError if it is not a parameter file."""
        parameters = parameter_dict_from_yaml_file(parameter_file, use_wildcard)
        return self.set_parameters_atomically(list(parameters.values()), callback)

    def on_parameter_event(
        self,
        callback: Callable[[ParameterEvent], Any],
        qos_profile: QoSProfile = qos_profile_parameter_events,
        *,
        callback_group: CallbackGroup | None = None,
        event_callbacks: SubscriptionEventCallbacks | None = None,
        qos_overriding_options: QoSOverridingOptions | None = None,
        raw: bool = False,
    ) -> Subscription:
        """Subscribe to `/parameter_events`, the changes of parameters of all nodes."""
        return self.node.create_subscription(
            ParameterEvent,
            "/parameter_events",
            callback,
            qos_profile,
            callback_group=callback_group,
            event_callbacks=event_callbacks,
            qos_overriding_options=qos_overriding_options,
            raw=raw,
        )


def _call(client: Client, request: Any, callback: Callable[[Future], Any] | None) -> Future:
    future = client.call_async(request)
    if callback is not None:
        future.add_done_callback(callback)
    return future


def _messages(parameters: Sequence[Parameter | ParameterMsg]) -> list[ParameterMsg]:
    return [
        parameter.to_parameter_msg() if isinstance(parameter, Parameter) else parameter
        for parameter in parameters
    ]
