"""The states of a lifecycle node, and the transitions between them (design.ros2.org, "Managed nodes")."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

from lifecycle_msgs.msg import State, Transition, TransitionEvent
from rclpy.exceptions import RCLError
from rclpy.qos import QoSProfile

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.service import Service


class TransitionCallbackReturn(Enum):
    """What the callback of a transition returns."""

    SUCCESS = Transition.TRANSITION_CALLBACK_SUCCESS
    FAILURE = Transition.TRANSITION_CALLBACK_FAILURE
    ERROR = Transition.TRANSITION_CALLBACK_ERROR

    def to_label(self) -> str:
        """Return the label of the transition that follows the callback."""
        return f"transition_{self.name.lower()}"


class TransitionDescription(NamedTuple):
    id: int
    label: str
    start: int
    goal: int


_UNCONFIGURED = State.PRIMARY_STATE_UNCONFIGURED
_INACTIVE = State.PRIMARY_STATE_INACTIVE
_ACTIVE = State.PRIMARY_STATE_ACTIVE
_FINALIZED = State.PRIMARY_STATE_FINALIZED
_CONFIGURING = State.TRANSITION_STATE_CONFIGURING
_CLEANINGUP = State.TRANSITION_STATE_CLEANINGUP
_SHUTTINGDOWN = State.TRANSITION_STATE_SHUTTINGDOWN
_ACTIVATING = State.TRANSITION_STATE_ACTIVATING
_DEACTIVATING = State.TRANSITION_STATE_DEACTIVATING
_ERRORPROCESSING = State.TRANSITION_STATE_ERRORPROCESSING

STATES: dict[int, str] = {
    State.PRIMARY_STATE_UNKNOWN: "unknown",
    _UNCONFIGURED: "unconfigured",
    _INACTIVE: "inactive",
    _ACTIVE: "active",
    _FINALIZED: "finalized",
    _CONFIGURING: "configuring",
    _CLEANINGUP: "cleaningup",
    _SHUTTINGDOWN: "shuttingdown",
    _ACTIVATING: "activating",
    _DEACTIVATING: "deactivating",
    _ERRORPROCESSING: "errorprocessing",
}
"""Labels of the states."""


def _outcomes(
    first_id: int, state: int, success: int, failure: int, error: int = _ERRORPROCESSING
) -> list[TransitionDescription]:
    """Return the transitions that follow a callback; their numbers are consecutive."""
    goals = zip(TransitionCallbackReturn, (success, failure, error), strict=True)
    return [
        TransitionDescription(first_id + number, outcome.to_label(), state, goal)
        for number, (outcome, goal) in enumerate(goals)
    ]


TRANSITIONS = (
    TransitionDescription(Transition.TRANSITION_CONFIGURE, "configure", _UNCONFIGURED, _CONFIGURING),
    *_outcomes(Transition.TRANSITION_ON_CONFIGURE_SUCCESS, _CONFIGURING, _INACTIVE, _UNCONFIGURED),
    TransitionDescription(Transition.TRANSITION_CLEANUP, "cleanup", _INACTIVE, _CLEANINGUP),
    *_outcomes(Transition.TRANSITION_ON_CLEANUP_SUCCESS, _CLEANINGUP, _UNCONFIGURED, _INACTIVE),
    TransitionDescription(Transition.TRANSITION_ACTIVATE, "activate", _INACTIVE, _ACTIVATING),
    *_outcomes(Transition.TRANSITION_ON_ACTIVATE_SUCCESS, _ACTIVATING, _ACTIVE, _INACTIVE),
    TransitionDescription(Transition.TRANSITION_DEACTIVATE, "deactivate", _ACTIVE, _DEACTIVATING),
    *_outcomes(Transition.TRANSITION_ON_DEACTIVATE_SUCCESS, _DEACTIVATING, _INACTIVE, _ACTIVE),
    TransitionDescription(
        Transition.TRANSITION_UNCONFIGURED_SHUTDOWN, "shutdown", _UNCONFIGURED, _SHUTTINGDOWN
    ),
    TransitionDescription(Transition.TRANSITION_INACTIVE_SHUTDOWN, "shutdown", _INACTIVE, _SHUTTINGDOWN),
    TransitionDescription(Transition.TRANSITION_ACTIVE_SHUTDOWN, "shutdown", _ACTIVE, _SHUTTINGDOWN),
    *_outcomes(Transition.TRANSITION_ON_SHUTDOWN_SUCCESS, _SHUTTINGDOWN, _FINALIZED, _FINALIZED),
    *_outcomes(
        Transition.TRANSITION_ON_ERROR_SUCCESS, _ERRORPROCESSING, _UNCONFIGURED, _FINALIZED, _FINALIZED
    ),
)
"""All transitions, in the order of rcl_lifecycle."""


class LifecycleStateMachine:
    """The state of a node, which publishes its changes on ``~/transition_event``."""

    initialized = True
    service_change_state: Service | None = None
    service_get_state: Service | None = None
    service_get_available_states: Service | None = None
    service_get_available_transitions: Service | None = None
    service_get_transition_graph: Service | None = None

    def __init__(self, node: Node) -> None:
        self._state = _UNCONFIGURED
        self._events = node._rclpy_create_own_publisher(
            TransitionEvent, "~/transition_event", QoSProfile(depth=10)
        )

    @property
    def current_state(self) -> tuple[int, str]:
        return self._state, STATES[self._state]

    @property
    def available_transitions(self) -> list[TransitionDescription]:
        return [transition for transition in TRANSITIONS if transition.start == self._state]

    def get_transition_by_label(self, label: str) -> int:
        """Return the identifier of a transition from the state. Raises RCLError if there is none."""
        return self._find("label", label).id

    def trigger_transition_by_id(self, transition_id: int) -> None:
        """Change the state. Raises RCLError if it has no such transition."""
        self._follow(self._find("id", transition_id))

    def trigger_transition_by_label(self, label: str) -> None:
        """Change the state. Raises RCLError if it has no such transition."""
        self._follow(self._find("label", label))

    def _find(self, key: str, value: int | str) -> TransitionDescription:
        for transition in self.available_transitions:
            if getattr(transition, key) == value:
                return transition
        raise RCLError(
            "Failed to trigger lifecycle state machine transition:"
            f" No transition matching {value} found for current state {STATES[self._state]}"
        )

    def _follow(self, transition: TransitionDescription) -> None:
        self._state = transition.goal
        self._events.publish(
            TransitionEvent(
                start_state=State(id=transition.start, label=STATES[transition.start]),
                goal_state=State(id=transition.goal, label=STATES[transition.goal]),
            )
        )
