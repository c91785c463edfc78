"""The parameters of other nodes that the page sets and shows, as observables."""

from __future__ import annotations

from typing import Any, NamedTuple

import reactivex as rx
from rcl_interfaces.msg import ParameterEvent, SetParametersResult
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import qos_profile_parameter_events
from reactivex import Observable

from reactive_node import ReactiveNode

TIMEOUT = 2.0  # s for an answer


class ParameterChange(NamedTuple):
    program: str
    name: str
    value: Any


def parameter_changes(node: ReactiveNode) -> Observable[ParameterChange]:
    """Emit each parameter that is set on a node of the arm, even to the same value; a start sets none."""
    prefix = node.get_namespace().rstrip("/") + "/"

    def changes(event: ParameterEvent) -> Observable[ParameterChange]:
        program = event.node.removeprefix(prefix)
        parameters = map(Parameter.from_parameter_msg, event.changed_parameters)
        return rx.from_iterable(ParameterChange(program, each.name, each.value) for each in parameters)

    events = node.create_observable(ParameterEvent, "/parameter_events", qos_profile_parameter_events)
    return events.filter(lambda event: event.node.startswith(prefix)).flat_map(changes)


class RemoteParameters:
    """The parameters of a program. Calls that get no answer end in a TimeoutError."""

    def __init__(self, node: ReactiveNode, program: str) -> None:
        self._get = node.create_call(GetParameters, f"{program}/get_parameters", timeout=TIMEOUT)
        self._set = node.create_call(SetParameters, f"{program}/set_parameters", timeout=TIMEOUT)

    def get(self, name: str) -> Observable[Any]:
        """Emit the value of a parameter; ``None`` if the program does not have it."""
        response = self._get(GetParameters.Request(names=[name]))
        return response.map(lambda it: parameter_value_to_python(it.values[0]) if it.values else None)

    def set(self, name: str, value: Any) -> Observable[str]:
        """Set a parameter; emits why that fails, or an empty string."""
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        return self._set(request).map(lambda it: _reason(it.results[0]))


def _reason(result: SetParametersResult) -> str:
    return "" if result.successful else result.reason or "the parameter cannot be set"
