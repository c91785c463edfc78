"""The parameter client and the parameter event handler: requests and callbacks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterEvent, ParameterValue
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.parameter_event_handler import ParameterEventHandler
from rclpy.task import Future


class Client:
    """A client that keeps its requests; ``ready`` says whether it has a server."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.ready = True
        self.requests: list[Any] = []

    def service_is_ready(self) -> bool:
        return self.ready

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        return self.ready

    def call_async(self, request: Any) -> Future:
        self.requests.append(request)
        future = Future()
        future.set_result(request)
        return future


class Node:
    def __init__(self, namespace: str = "/ns") -> None:
        self.namespace = namespace
        self.clients: dict[str, Client] = {}
        self.subscriptions: list[tuple[str, Callable[[ParameterEvent], None]]] = []

    def get_fully_qualified_name(self) -> str:
        return f"{self.namespace.rstrip('/')}/me"

    def get_namespace(self) -> str:
        return self.namespace

    def create_client(self, srv_type: Any, srv_name: str, **options: Any) -> Client:
        assert options.keys() == {"qos_profile", "callback_group"}
        self.clients[srv_name] = Client(srv_name)
        return self.clients[srv_name]

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[[ParameterEvent], None], *_: Any, **__: Any
    ) -> str:
        assert msg_type is ParameterEvent
        self.subscriptions.append((topic, callback))
        return topic

    def destroy_subscription(self, subscription: str) -> None:
        self.subscriptions.clear()


@pytest.fixture
def node() -> Node:
    return Node()


def client_of(node: Node) -> AsyncParameterClient:
    return AsyncParameterClient(node, "other")  # type: ignore[arg-type]


def test_all_services_must_be_available(node: Node) -> None:
    client = client_of(node)
    assert len(node.clients) == 6
    assert client.services_are_ready()
    assert client.wait_for_services(timeout_sec=1.0)
    node.clients["other/list_parameters"].ready = False
    assert not client.services_are_ready()
    assert not client.wait_for_services(timeout_sec=0.0)


def test_parameters_are_set_as_values_or_messages(node: Node) -> None:
    client = client_of(node)
    parameter = Parameter("a", value=1)
    message = ParameterMsg(name="b", value=ParameterValue(type=4, string_value="x"))
    for request in (
        client.set_parameters([parameter, message]).result(),
        client.set_parameters_atomically([parameter, message]).result(),
    ):
        assert request.parameters == [parameter.to_parameter_msg(), message]
    assert len(node.clients["other/set_parameters_atomically"].requests) == 1


def test_a_file_is_loaded_parameter_by_parameter_or_atomically(node: Node, tmp_path: Path) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text("/other: {ros__parameters: {a: 1, b: {c: x}}}\n/**: {ros__parameters: {d: 2.5}}")
    client = client_of(node)
    request = client.load_parameter_file(str(path)).result()
    assert [parameter.name for parameter in request.parameters] == ["a", "b.c"]
    request = client.load_parameter_file_atomically(str(path), use_wildcard=True).result()
    assert [parameter.name for parameter in request.parameters] == ["d", "a", "b.c"]
    assert len(node.clients["other/set_parameters_atomically"].requests) == 1


# The event handler


def event(node_name: str = "/ns/other", **values: int) -> ParameterEvent:
    parameters = [
        ParameterMsg(name=name, value=ParameterValue(type=2, integer_value=value))
        for name, value in values.items()
    ]
    return ParameterEvent(node=node_name, new_parameters=parameters[:1], changed_parameters=parameters[1:])


def handler_of(node: Node) -> ParameterEventHandler:
    return ParameterEventHandler(node)  # type: ignore[arg-type]


def test_a_node_in_the_root_namespace_resolves_node_names_there() -> None:
    node = Node("/")
    handler = handler_of(node)
    values: list[ParameterMsg] = []
    handler.add_parameter_callback("a", "other", values.append)
    node.subscriptions[0][1](event("/other", a=1))
    assert len(values) == 1


def test_newest_callbacks_run_first_and_event_callbacks_run_last(node: Node) -> None:
    handler, calls = handler_of(node), []
    handler.add_parameter_event_callback(lambda event: calls.append("event 1"))
    handler.add_parameter_event_callback(lambda event: calls.append("event 2"))
    handler.add_parameter_callback("a", "other", lambda message: calls.append("parameter 1"))
    handler.add_parameter_callback("a", "other", lambda message: calls.append("parameter 2"))
    node.subscriptions[0][1](event(a=1))
    assert calls == ["parameter 2", "parameter 1", "event 2", "event 1"]


def test_a_removed_callback_is_not_called_and_cannot_be_removed_again(node: Node) -> None:
    handler = handler_of(node)
    calls: list[object] = []
    parameter_handle = handler.add_parameter_callback("a", "other", calls.append)
    event_handle = handler.add_parameter_event_callback(calls.append)
    handler.remove_parameter_callback(parameter_handle)
    handler.remove_parameter_event_callback(event_handle)
    node.subscriptions[0][1](event(a=1))
    assert calls == []
    with pytest.raises(RuntimeError, match="doesn't exist"):
        handler.remove_parameter_callback(parameter_handle)
    with pytest.raises(RuntimeError, match="doesn't exist"):
        handler.remove_parameter_event_callback(event_handle)


def test_all_new_values_of_an_event_can_be_read(node: Node) -> None:
    message = event(a=1, b=2)
    found = ParameterEventHandler.get_parameters_from_event(message)
    assert [parameter.name for parameter in found] == ["a", "b"]
    assert ParameterEventHandler.get_parameter_from_event(message, "b", "/ns/other") is not None
    assert ParameterEventHandler.get_parameter_from_event(message, "c", "/ns/other") is None
    assert ParameterEventHandler.get_parameter_from_event(message, "b", "/ns/me") is None


def test_destroying_a_handler_destroys_its_subscription(node: Node) -> None:
    handler_of(node).destroy()
    assert node.subscriptions == []
