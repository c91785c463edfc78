"""Classes of actions: their messages, and the services and messages that transport them."""

from __future__ import annotations

import importlib
import pickle
from typing import Any

import pytest
from deploy.runtime.tests.conformance.fibonacci import PACKAGE, Fibonacci

import action_msgs.msg
import action_msgs.srv
from rclpy.serialization import deserialize_message, serialize_message


def test_an_action_has_a_goal_a_result_and_feedback() -> None:
    assert Fibonacci.Goal(order=5).order == 5
    assert list(Fibonacci.Result(sequence=[0, 1, 1]).sequence) == [0, 1, 1]
    assert list(Fibonacci.Feedback().sequence) == []
    assert repr(Fibonacci.Goal(order=5)) == f"{PACKAGE}.action.Fibonacci_Goal(order=5)"


def test_an_action_cannot_be_instantiated() -> None:
    with pytest.raises(NotImplementedError, match="Action classes can not be instantiated"):
        Fibonacci()


def test_an_action_knows_the_types_that_transport_it() -> None:
    impl = Fibonacci.Impl
    assert impl.CancelGoalService is action_msgs.srv.CancelGoal
    assert impl.GoalStatusMessage is action_msgs.msg.GoalStatusArray
    action_module = importlib.import_module(f"{PACKAGE}.action")
    assert impl.SendGoalService.Request is action_module.Fibonacci_SendGoal_Request
    assert impl.GetResultService.Response is action_module.Fibonacci_GetResult_Response
    assert impl.FeedbackMessage.__name__ == "Fibonacci_FeedbackMessage"


@pytest.mark.parametrize(
    ("cls", "fields"),
    [
        (Fibonacci.Goal, {"order": "int32"}),
        (
            Fibonacci.Impl.SendGoalService.Request,
            {"goal_id": "unique_identifier_msgs/UUID", "goal": f"{PACKAGE}/Fibonacci_Goal"},
        ),
        (
            Fibonacci.Impl.SendGoalService.Response,
            {"accepted": "boolean", "stamp": "builtin_interfaces/Time"},
        ),
        (Fibonacci.Impl.GetResultService.Request, {"goal_id": "unique_identifier_msgs/UUID"}),
        (
            Fibonacci.Impl.GetResultService.Response,
            {"status": "int8", "result": f"{PACKAGE}/Fibonacci_Result"},
        ),
        (
            Fibonacci.Impl.FeedbackMessage,
            {"goal_id": "unique_identifier_msgs/UUID", "feedback": f"{PACKAGE}/Fibonacci_Feedback"},
        ),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_the_messages_of_an_action_have_the_fields_of_rosidl(cls: Any, fields: dict[str, str]) -> None:
    assert cls.get_fields_and_field_types() == fields


def test_the_messages_of_an_action_are_serialized_and_pickled() -> None:
    feedback = Fibonacci.Impl.FeedbackMessage(feedback=Fibonacci.Feedback(sequence=[1, 2]))
    feedback.goal_id.uuid[15] = 7
    data = serialize_message(feedback)
    assert data.hex() == "00010000" + "00" * 15 + "07" + "02000000" + "01000000" + "02000000"
    assert deserialize_message(data, Fibonacci.Impl.FeedbackMessage) == feedback
    assert pickle.loads(pickle.dumps(feedback)) == feedback
