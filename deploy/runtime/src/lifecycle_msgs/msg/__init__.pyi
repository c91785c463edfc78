"""Messages of lifecycle_msgs. Made by rosidl_runtime_embedded.stubs."""

from typing import Final

from rosidl_runtime_embedded import Message

class State(Message):
    id: int
    label: str
    PRIMARY_STATE_UNKNOWN: Final = 0
    PRIMARY_STATE_UNCONFIGURED: Final = 1
    PRIMARY_STATE_INACTIVE: Final = 2
    PRIMARY_STATE_ACTIVE: Final = 3
    PRIMARY_STATE_FINALIZED: Final = 4
    TRANSITION_STATE_CONFIGURING: Final = 10
    TRANSITION_STATE_CLEANINGUP: Final = 11
    TRANSITION_STATE_SHUTTINGDOWN: Final = 12
    TRANSITION_STATE_ACTIVATING: Final = 13
    TRANSITION_STATE_DEACTIVATING: Final = 14
    TRANSITION_STATE_ERRORPROCESSING: Final = 15
    def __init__(
        self,
        *,
        id: int = ...,
        label: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Transition(Message):
    id: int
    label: str
    TRANSITION_CREATE: Final = 0
    TRANSITION_CONFIGURE: Final = 1
    TRANSITION_CLEANUP: Final = 2
    TRANSITION_ACTIVATE: Final = 3
    TRANSITION_DEACTIVATE: Final = 4
    TRANSITION_UNCONFIGURED_SHUTDOWN: Final = 5
    TRANSITION_INACTIVE_SHUTDOWN: Final = 6
    TRANSITION_ACTIVE_SHUTDOWN: Final = 7
    TRANSITION_DESTROY: Final = 8
    TRANSITION_ON_CONFIGURE_SUCCESS: Final = 10
    TRANSITION_ON_CONFIGURE_FAILURE: Final = 11
    TRANSITION_ON_CONFIGURE_ERROR: Final = 12
    TRANSITION_ON_CLEANUP_SUCCESS: Final = 20
    TRANSITION_ON_CLEANUP_FAILURE: Final = 21
    TRANSITION_ON_CLEANUP_ERROR: Final = 22
    TRANSITION_ON_ACTIVATE_SUCCESS: Final = 30
    TRANSITION_ON_ACTIVATE_FAILURE: Final = 31
    TRANSITION_ON_ACTIVATE_ERROR: Final = 32
    TRANSITION_ON_DEACTIVATE_SUCCESS: Final = 40
    TRANSITION_ON_DEACTIVATE_FAILURE: Final = 41
    TRANSITION_ON_DEACTIVATE_ERROR: Final = 42
    TRANSITION_ON_SHUTDOWN_SUCCESS: Final = 50
    TRANSITION_ON_SHUTDOWN_FAILURE: Final = 51
    TRANSITION_ON_SHUTDOWN_ERROR: Final = 52
    TRANSITION_ON_ERROR_SUCCESS: Final = 60
    TRANSITION_ON_ERROR_FAILURE: Final = 61
    TRANSITION_ON_ERROR_ERROR: Final = 62
    TRANSITION_CALLBACK_SUCCESS: Final = 97
    TRANSITION_CALLBACK_FAILURE: Final = 98
    TRANSITION_CALLBACK_ERROR: Final = 99
    def __init__(
        self,
        *,
        id: int = ...,
        label: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class TransitionDescription(Message):
    transition: Transition
    start_state: State
    goal_state: State
    def __init__(
        self,
        *,
        transition: Transition = ...,
        start_state: State = ...,
        goal_state: State = ...,
        check_fields: bool = ...,
    ) -> None: ...

class TransitionEvent(Message):
    timestamp: int
    transition: Transition
    start_state: State
    goal_state: State
    def __init__(
        self,
        *,
        timestamp: int = ...,
        transition: Transition = ...,
        start_state: State = ...,
        goal_state: State = ...,
        check_fields: bool = ...,
    ) -> None: ...
