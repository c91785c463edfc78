"""The parameters of other nodes that the page sets and shows, as observables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import reactivex as rx
from rcl_interfaces.msg import ParameterEvent, SetParametersResult
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import qos_profile_parameter_events
from reactivex import Observable

from interfaces.topics import EVERY_SERVICE, OPERATOR_NODES, Topic
from reactive_node import ReactiveNode

TIMEOUT = 2.0  # s for an answer


class ParameterChange(NamedTuple):
    program: str
    name: str
    value: Any
    together: Mapping[str, Any] = {}
    """All parameters that were set in the same request, by name."""


def _not_parameters(event: ParameterEvent) -> str:
    try:
        _changed(event)
    except ValueError as error:  # of a type that rclpy does not know
        return f"{event.node[:40]!r} has changed a parameter: {error}"
    return ""


PARAMETER_EVENTS = Topic(
    "/parameter_events",
    ParameterEvent,
    qos_profile_parameter_events,
    "",
    (EVERY_SERVICE,),
    OPERATOR_NODES,
    "parameters that were set",
    _not_parameters,
)
"""ROS 2's own topic, which every process may write."""


def parameter_changes(events: Observable[ParameterEvent], namespace: str) -> Observable[ParameterChange]:
    """Emit each parameter that is set on a node of the arm, even to the same value; a start sets none.

    :param events: the good ones of :data:`PARAMETER_EVENTS`.
    :param namespace: that of the arm.
    """
    prefix = namespace.rstrip("/") + "/"

    def changes(event: ParameterEvent) -> Observable[ParameterChange]:
        program = event.node.removeprefix(prefix)
        together = {each.name: each.value for each in _changed(event)}
        return rx.from_iterable(ParameterChange(program, *each, together) for each in together.items())

    return events.filter(lambda event: event.node.startswith(prefix)).flat_map(changes)


def _changed(event: ParameterEvent) -> list[Parameter]:
    return [Parameter.from_parameter_msg(each) for each in event.changed_parameters]


class RemoteParameters:
    """The parameters of a program. Calls that get no answer end in a TimeoutError."""

    def __init__(self, node: ReactiveNode, program: str) -> None:
        self._get = node.create_call(GetParameters, f"{program}/get_parameters", timeout=TIMEOUT)
        self._set = node.create_call(SetParameters, f"{program}/set_parameters", timeout=TIMEOUT)
        together = f"{program}/set_parameters_atomically"
        self._set_together = node.create_call(SetParametersAtomically, together, timeout=TIMEOUT)

    def get(self, name: str) -> Observable[Any]:
        """Emit the value of a parameter; ``None`` if the program does not have it."""
        response = self._get(GetParameters.Request(names=[name]))
        return response.map(lambda it: parameter_value_to_python(it.values[0]) if it.values else None)

    def set(self, name: str, value: Any) -> Observable[str]:
        """Set a parameter; emits why that fails, or an empty string."""
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        return self._set(request).map(lambda it: _reason(it.results))

    def set_together(self, values: Mapping[str, Any]) -> Observable[str]:
        """Set all of these parameters or none, see :meth:`set`; one event shows all."""
        parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=parameters)
        return self._set_together(request).map(lambda it: _reason([it.result]))


def _reason(results: Sequence[SetParametersResult]) -> str:
    if not results:
        return "the answer is empty"
    return "" if results[0].successful else results[0].reason or "the parameter cannot be set"
