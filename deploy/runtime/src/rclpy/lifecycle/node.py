"""Lifecycle nodes."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

import lifecycle_msgs.msg
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rclpy.callback_groups import CallbackGroup
from rclpy.exceptions import RCLError
from rclpy.lifecycle._state_machine import (
    STATES,
    TRANSITIONS,
    LifecycleStateMachine,
    TransitionCallbackReturn,
    TransitionDescription,
)
from rclpy.lifecycle.managed_entity import ManagedEntity
from rclpy.lifecycle.publisher import LifecyclePublisher
from rclpy.node import Node

_SHUTDOWNS = {
    "unconfigured": Transition.TRANSITION_UNCONFIGURED_SHUTDOWN,
    "inactive": Transition.TRANSITION_INACTIVE_SHUTDOWN,
    "active": Transition.TRANSITION_ACTIVE_SHUTDOWN,
}


class LifecycleState(NamedTuple):
    label: str
    state_id: int


class LifecycleNodeMixin(ManagedEntity):
    """Makes a subclass of :class:`rclpy.node.Node` a lifecycle node; its constructor follows the node's."""

    if TYPE_CHECKING:
        # of rclpy.node.Node
        default_callback_group: CallbackGroup
        create_service: Callable[..., Any]
        get_logger: Callable[[], Any]

    def __init__(
        self,
        *,
        enable_communication_interface: bool = True,
        callback_group: CallbackGroup | None = None,
    ) -> None:
        """Initialize the lifecycle.

        :param enable_communication_interface: whether other nodes may ask for transitions.
        :param callback_group: the group of the services for this; the node's default group if ``None``.
        :raises TypeError: if ``enable_communication_interface`` is not a bool.
        """
        if not isinstance(enable_communication_interface, bool):
            raise TypeError(
                f"enable_communication_interface must be a bool, not {enable_communication_interface!r}"
            )
        self._callbacks: dict[int, Callable[[LifecycleState], TransitionCallbackReturn]] = {
            State.TRANSITION_STATE_CONFIGURING: self.on_configure,
            State.TRANSITION_STATE_CLEANINGUP: self.on_cleanup,
            State.TRANSITION_STATE_SHUTTINGDOWN: self.on_shutdown,
            State.TRANSITION_STATE_ACTIVATING: self.on_activate,
            State.TRANSITION_STATE_DEACTIVATING: self.on_deactivate,
            State.TRANSITION_STATE_ERRORPROCESSING: self.on_error,
        }
        self._managed_entities: dict[ManagedEntity, None] = {}  # in order
        assert isinstance(self, Node)
        self._state_machine = LifecycleStateMachine(self)
        if not enable_communication_interface:
            return
        services: dict[str, tuple[type[Any], Callable[[Any, Any], Any]]] = {
            "change_state": (ChangeState, self.__on_change_state),
            "get_state": (GetState, self.__on_get_state),
            "get_available_states": (GetAvailableStates, self.__on_get_available_states),
            "get_available_transitions": (GetAvailableTransitions, self.__on_get_available_transitions),
            "get_transition_graph": (GetAvailableTransitions, self.__on_get_transition_graph),
        }
        for name, (srv_type, callback) in services.items():
            service = Node.create_service(
                self, srv_type, f"~/{name}", callback, callback_group=callback_group
            )
            setattr(self, f"_service_{name}", service)
            setattr(self._state_machine, f"service_{name}", service)

    # Transitions

    def trigger_configure(self) -> TransitionCallbackReturn:
        """Configure; return the result of the callback. Raises RCLError if the state does not allow it."""
        return self.__change_state(Transition.TRANSITION_CONFIGURE)

    def trigger_cleanup(self) -> TransitionCallbackReturn:
        return self.__change_state(Transition.TRANSITION_CLEANUP)

    def trigger_shutdown(self) -> TransitionCallbackReturn:
        transition = _SHUTDOWNS.get(self._state_machine.current_state[1])
        if transition is None:
            raise RCLError("Shutdown transition not possible")
        return self.__change_state(transition)

    def trigger_activate(self) -> TransitionCallbackReturn:
        return self.__change_state(Transition.TRANSITION_ACTIVATE)

    def trigger_deactivate(self) -> TransitionCallbackReturn:
        return self.__change_state(Transition.TRANSITION_DEACTIVATE)

    def __change_state(self, transition_id: int) -> TransitionCallbackReturn:
        machine = self._state_machine
        state_id, label = machine.current_state
        previous = LifecycleState(label=label, state_id=state_id)
        machine.trigger_transition_by_id(transition_id)
        result = self.__call_back(previous)
        machine.trigger_transition_by_label(result.to_label())
        if result is TransitionCallbackReturn.ERROR:
            machine.trigger_transition_by_label(self.__call_back(previous).to_label())
        return result

    def __call_back(self, previous: LifecycleState) -> TransitionCallbackReturn:
        """Run the callback of the state, which is that of a transition."""
        state_id, label = self._state_machine.current_state
        try:
            result = self._callbacks[state_id](previous)
        except Exception:
            self.get_logger().error(f"Error raised while {label}: {traceback.format_exc()}")
            return TransitionCallbackReturn.ERROR
        if not isinstance(result, TransitionCallbackReturn):
            self.get_logger().error(
                f"The callback for {label} must return a TransitionCallbackReturn, not {result!r}"
            )
            return TransitionCallbackReturn.ERROR
        return result

    # Managed entities

    def add_managed_entity(self, entity: ManagedEntity) -> None:
        """Let an entity take part in transitions. Raises TypeError if it is not a ManagedEntity."""
        if not isinstance(entity, ManagedEntity):
            raise TypeError("Expected a rclpy.lifecycle.ManagedEntity instance.")
        self._managed_entities[entity] = None

    def create_lifecycle_publisher(self, *args: Any, **kwargs: Any) -> LifecyclePublisher:
        """Create a publisher that publishes only while the node is active, as ``create_publisher`` does."""
        if "publisher_class" in kwargs:
            raise TypeError("create_publisher() got an unexpected keyword argument 'publisher_class'")
        publisher: Any = Node.create_publisher(self, *args, **kwargs, publisher_class=LifecyclePublisher)  # type: ignore[arg-type]
        self._managed_entities[publisher] = None
        created: LifecyclePublisher = publisher
        return created

    def destroy_lifecycle_publisher(self, publisher: LifecyclePublisher) -> bool:
        """Destroy such a publisher; return ``False`` if the node does not have it."""
        self._managed_entities.pop(publisher, None)
        return Node.destroy_publisher(self, publisher)  # type: ignore[arg-type]

    def __forward(self, callback_name: str, state: LifecycleState) -> TransitionCallbackReturn:
        """Call the managed entities; end with the first that does not succeed."""
        for entity in self._managed_entities:
            result = getattr(entity, callback_name)(state)
            if not isinstance(result, TransitionCallbackReturn):
                raise TypeError(
                    f"{callback_name}() of {entity} must return a TransitionCallbackReturn, not {result!r}"
                )
            if result is not TransitionCallbackReturn.SUCCESS:
                return result
        return TransitionCallbackReturn.SUCCESS

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Configure all managed entities; subclasses that override this call it."""
        return self.__forward("on_configure", state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self.__forward("on_cleanup", state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self.__forward("on_shutdown", state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self.__forward("on_activate", state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self.__forward("on_deactivate", state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let all managed entities handle an error; subclasses that override this call it."""
        return self.__forward("on_error", state)

    # Services

    def __on_change_state(self, request: Any, response: Any) -> Any:
        try:
            transition_id = request.transition.id
            if request.transition.label:
                transition_id = self._state_machine.get_transition_by_label(request.transition.label)
            result = self.__change_state(transition_id)
        except RCLError as error:
            self.get_logger().warning(str(error))
            response.success = False
        else:
            response.success = result is TransitionCallbackReturn.SUCCESS
        return response

    def __on_get_state(self, request: Any, response: Any) -> Any:
        response.current_state.id, response.current_state.label = self._state_machine.current_state
        return response

    def __on_get_available_states(self, request: Any, response: Any) -> Any:
        response.available_states = [State(id=state, label=label) for state, label in STATES.items()]
        return response

    def __on_get_available_transitions(self, request: Any, response: Any) -> Any:
        response.available_transitions = _messages(self._state_machine.available_transitions)
        return response

    def __on_get_transition_graph(self, request: Any, response: Any) -> Any:
        response.available_transitions = _messages(TRANSITIONS)
        return response


def _messages(
    transitions: Iterable[TransitionDescription],
) -> list[lifecycle_msgs.msg.TransitionDescription]:
    return [
        lifecycle_msgs.msg.TransitionDescription(
            transition=Transition(id=transition.id, label=transition.label),
            start_state=State(id=transition.start, label=STATES[transition.start]),
            goal_state=State(id=transition.goal, label=STATES[transition.goal]),
        )
        for transition in transitions
    ]


class LifecycleNode(LifecycleNodeMixin, Node):
    def __init__(self, node_name: str, *, enable_communication_interface: bool = True, **kwargs: Any) -> None:
        """Create a lifecycle node; ``kwargs`` are the other arguments of :class:`rclpy.node.Node`."""
        Node.__init__(self, node_name, **kwargs)
        LifecycleNodeMixin.__init__(self, enable_communication_interface=enable_communication_interface)
