"""What others send is data: whatever it is, it becomes a value or a reason."""

from __future__ import annotations

import math
import struct

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from hypothesis import given
from hypothesis import strategies as st
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterValue
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

from deploy.operator.remote import PARAMETER_EVENTS
from interfaces import cause, topics
from interfaces.cause import Cause
from interfaces.limits import LARGEST_MESSAGE, bad_report, number, seconds, whole
from interfaces.service.reading import reading
from tests.messages import NUMBERS, TEXTS, octets, reports

READ = (*topics.CONTRACT, PARAMETER_EVENTS)
GOOD = {
    topics.OPERATOR_HEARTBEAT.name: True,
    topics.OPERATOR_ACTIVITY.name: topics.ALIVE,
    topics.ENGINES.name: topics.TURN_ON,
    topics.ENGINES_STATE.name: topics.ON,
    topics.ENGINES_SENDER.name: topics.Sender(topics.TURN_ON, "terminal"),
    topics.ENGINES_CAUSE.name: cause.message(Cause("off", cause.STARTED)),
    topics.OPERATOR_HAND.name: Header(frame_id="terminal"),
}


class Reader:
    def __init__(self, topic: topics.Topic) -> None:
        self.reasons: list[str] = []
        self.read = reading(topic, lambda name, reason: self.reasons.append(reason))["item"]


@pytest.mark.parametrize("topic", READ, ids=lambda topic: topic.name)
@given(st.data())
def test_any_octets_are_a_value_or_a_reason(topic: topics.Topic, data: st.DataObject) -> None:
    reader = Reader(topic)
    value = reader.read(data.draw(octets(topic.type)))
    assert (value is None) == bool(reader.reasons)
    good = topic.message(GOOD[topic.name]) if topic.name in GOOD else topic.type()
    assert reader.read(serialize_message(good)) is not None, "a good message after it"


@given(reports("/velocity", "/sentinel"))
def test_any_report_is_read_or_refused(message: DiagnosticArray) -> None:
    reader = Reader(topics.DIAGNOSTICS)
    value = reader.read(serialize_message(message))
    assert (value is None) == bool(reader.reasons)


@pytest.mark.parametrize("topic", READ, ids=lambda topic: topic.name)
def test_message_that_is_too_large_is_not_deserialized(
    topic: topics.Topic, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("interfaces.service.reading.deserialize_message", pytest.fail)
    reader = Reader(topic)
    assert reader.read(bytes(LARGEST_MESSAGE + 1)) is None
    assert reader.reasons == [f"more than {LARGEST_MESSAGE} octets"]


def test_largest_message_that_lies_about_its_length_is_only_bad() -> None:
    reader = Reader(topics.DIAGNOSTICS)
    head = b"\0\1\0\0" + struct.pack("<iIII", 0, 0, 1, 0)
    for count in (LARGEST_MESSAGE - 24, 2**31, 2**32 - 1):
        lie = (head + struct.pack("<I", count)).ljust(LARGEST_MESSAGE, b"\0")
        assert reader.read(lie) is None
    assert len(reader.reasons) == 3


@given(NUMBERS | TEXTS)
def test_number_in_a_text_is_in_range_or_refused(text: str) -> None:
    for read, least in ((whole, 0.0), (seconds, 0.0), (number, -1e9)):
        try:
            found = read(text)
        except ValueError:
            continue
        assert least <= found <= 1e9
        assert math.isfinite(found)


@pytest.mark.parametrize(
    "text", ["9" * 4300, "9" * 4301, str(2**70), "-1", "٣", "²", "1_0", " 1", "", "1e400"]
)
def test_text_is_no_whole_number(text: str) -> None:
    with pytest.raises(ValueError, match="is no whole number"):
        whole(text)


def report(**values: str) -> DiagnosticArray:
    pairs = [KeyValue(key=key.replace("_", " "), value=value) for key, value in values.items()]
    return DiagnosticArray(status=[DiagnosticStatus(name="/velocity", values=pairs)])


@pytest.mark.parametrize(
    ("message", "problem"),
    [
        (report(pid="7", published="1"), ""),
        (report(pid=str(2**70), published="1"), f"'/velocity' reports pid '{2**70}'"),
        (report(process="velocity", restarts="9" * 4300), f"'/velocity' reports restarts '{'9' * 40}'"),
        (report(process="velocity", uptime="NaN"), "'/velocity' reports uptime 'NaN'"),
        (report(pid="first", temperature="hot"), ""),  # no report of ours
    ],
)
def test_bad_number_in_a_report_is_named(message: DiagnosticArray, problem: str) -> None:
    assert bad_report(message) == problem


def test_parameter_of_an_unknown_type_is_named() -> None:
    pressed = Parameter(name="pressed", value=ParameterValue(type=99))
    reader = Reader(PARAMETER_EVENTS)
    event = ParameterEvent(node="/dead_mans_switch", changed_parameters=[pressed])
    assert reader.read(serialize_message(event)) is None
    assert reader.reasons == ["'/dead_mans_switch' has changed a parameter: 99 is not a valid Parameter.Type"]
