"""The states of lifecycle nodes (design.ros2.org/articles/node_lifecycle.html)."""

from __future__ import annotations

from typing import Any

from rclpy_ground.genuine import RCLError, predefined
from rclpy_ground.handles import Destroyable
from rclpy_ground.nodes import Node
from rclpy_ground.services import Service
from rclpy_ground.topics import Publisher

_LABELS = {
    0: "unknown", 1: "unconfigured", 2: "inactive", 3: "active", 4: "finalized", 10: "configuring",
    11: "cleaningup", 12: "shuttingdown", 13: "activating", 14: "deactivating", 15: "errorprocessing",
}  # fmt: skip
_OUTCOMES = ("transition_success", "transition_failure", "transition_error")


def _after(first: int, state: int, *goals: int) -> list[tuple[int, str, int, int]]:
    return [(first + i, _OUTCOMES[i], state, goal) for i, goal in enumerate(goals)]


_TRANSITIONS = [
    (1, "configure", 1, 10), *_after(10, 10, 2, 1, 15),
    (2, "cleanup", 2, 11), *_after(20, 11, 1, 2, 15),
    (3, "activate", 2, 13), *_after(30, 13, 3, 2, 15),
    (4, "deactivate", 3, 14), *_after(40, 14, 2, 3, 15),
    (5, "shutdown", 1, 12), (6, "shutdown", 2, 12), (7, "shutdown", 3, 12), *_after(50, 12, 4, 4, 15),
    *_after(60, 15, 1, 4, 4),
]  # fmt: skip
_SERVICES = {
    "change_state": "ChangeState",
    "get_state": "GetState",
    "get_available_states": "GetAvailableStates",
    "get_available_transitions": "GetAvailableTransitions",
    "get_transition_graph": "GetAvailableTransitions",
}


class LifecycleStateMachine(Destroyable):
    initialized = True

    def __init__(self, node: Node, *arguments: Any) -> None:
        if not isinstance(arguments[-1], bool):
            raise TypeError("enable_com_interface must be a bool")
        super().__init__()
        from lifecycle_msgs import srv
        from lifecycle_msgs.msg import TransitionEvent

        self._state = 1
        self._event = TransitionEvent
        self._parts: list[Any] = []
        self._events = None
        if arguments[-1]:
            self._events = Publisher(
                node, TransitionEvent, "~/transition_event", predefined("qos_profile_default")
            )
            for name, type_name in _SERVICES.items():
                qos = predefined("qos_profile_services_default")
                service = Service(node, getattr(srv, type_name), f"~/{name}", qos)
                setattr(self, f"service_{name}", service)
                self._parts.append(service)
            self._parts.append(self._events)

    @property
    def current_state(self) -> tuple[int, str]:
        return self._state, _LABELS[self._state]

    @property
    def available_states(self) -> list[tuple[int, str]]:
        return [*_LABELS.items()]

    @property
    def transition_graph(self) -> list[tuple[int, str, int, str, int, str]]:
        return [
            (number, label, start, _LABELS[start], goal, _LABELS[goal])
            for number, label, start, goal in _TRANSITIONS
        ]

    @property
    def available_transitions(self) -> list[tuple[int, str, int, str, int, str]]:
        return [each for each in self.transition_graph if each[2] == self._state]

    def get_transition_by_label(self, label: str) -> int:
        return self._find(1, label)[0]

    def trigger_transition_by_id(self, transition_id: int, publish: bool) -> None:
        self._follow(self._find(0, transition_id), publish)

    def trigger_transition_by_label(self, label: str, publish: bool) -> None:
        self._follow(self._find(1, label), publish)

    def _find(self, place: int, value: int | str) -> tuple[int, str, int, str, int, str]:
        for transition in self.available_transitions:
            if transition[place] == value:
                return transition
        raise RCLError(
            "Failed to trigger lifecycle state machine transition: No transition matching"
            f" {value} found for current state {_LABELS[self._state]}"
        )

    def _follow(self, transition: tuple[int, str, int, str, int, str], publish: bool) -> None:
        from lifecycle_msgs.msg import State

        _, _, start, start_label, goal, goal_label = transition
        self._state = goal
        if publish and self._events is not None:
            self._events.publish(
                self._event(
                    start_state=State(id=start, label=start_label),
                    goal_state=State(id=goal, label=goal_label),
                )
            )

    def destroy(self) -> None:
        for part in self._parts:
            part.destroy_when_not_in_use()
