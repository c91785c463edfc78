"""Action classes with the interface of those that Jazzy's ``rosidl_generator_py`` generates."""

from __future__ import annotations

from typing import ClassVar

from .definition_files import action_definition
from .interface_class import make_class, module_of
from .message import Message, message_class
from .service import InterfaceTypeHash, Service, service_class


class Action:
    """Base of all action classes: three message classes, a name, and the types that transport them."""

    Goal: ClassVar[type[Message]]
    Result: ClassVar[type[Message]]
    Feedback: ClassVar[type[Message]]
    _TYPE_NAME: ClassVar[str]
    """``example_interfaces/action/Fibonacci``"""
    _TYPE_HASH: ClassVar[str] = InterfaceTypeHash()  # type: ignore[assignment]
    """``RIHS01_…``"""

    class Impl:
        """The services and messages of all actions of this type."""

        SendGoalService: ClassVar[type[Service]]
        GetResultService: ClassVar[type[Service]]
        FeedbackMessage: ClassVar[type[Message]]
        CancelGoalService: ClassVar[type[Service]]
        GoalStatusMessage: ClassVar[type[Message]]

    def __init__(self) -> None:
        raise NotImplementedError("Action classes can not be instantiated")


_classes: dict[str, type[Action]] = {}


def action_class(name: str) -> type[Action]:
    """Class of an action by its full name. Raises LookupError or InvalidDefinition."""
    if name not in _classes:
        _classes.setdefault(name, _make_action_class(name))
    return _classes[name]


def _make_action_class(full_name: str) -> type[Action]:
    definition = action_definition(full_name)
    name = full_name.rpartition("/")[2]
    transport = {
        "SendGoalService": service_class(definition.send_goal.name),
        "GetResultService": service_class(definition.get_result.name),
        "FeedbackMessage": message_class(definition.feedback_message.name),
        "CancelGoalService": service_class("action_msgs/srv/CancelGoal"),
        "GoalStatusMessage": message_class("action_msgs/msg/GoalStatusArray"),
    }
    names = {"__module__": module_of(full_name), "__qualname__": f"{name}.Impl"}
    namespace = {
        "__doc__": f"Action {full_name}.",
        "Goal": message_class(definition.goal.name),
        "Result": message_class(definition.result.name),
        "Feedback": message_class(definition.feedback.name),
        "Impl": type("Impl", (Action.Impl,), {**names, **transport}),
    }
    return make_class(Action, full_name, namespace)
