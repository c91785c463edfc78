from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
import reactivex as rx
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, PointStamped
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rclpy.time import Time
from reactivex.subject import Subject
from std_msgs.msg import Bool, Float64, Header, String

from interfaces import topics
from interfaces.service import Rejected, ServiceNode, parameter
from interfaces.service.parameters import Declaration, declarations
from reactive_node.stamps import Timestamp
from reactive_node.testing import MakeNode, SpinFor, SpinUntil


def one(name: str, default: Any, within: Any, meaning: str, *, unit: str = "", settable: bool = False) -> Any:
    field = parameter(default, within, unit, meaning, settable=settable)
    return dataclasses.make_dataclass("Parameters", [(name, type(default), field)], frozen=True)


@pytest.fixture
def health(service: ServiceNode, peer: Node, spin_until: SpinUntil) -> Callable[[], dict[str, Any]]:
    heard: list[Any] = []
    topic = topics.DIAGNOSTICS
    peer.create_subscription(topic.type, topic.name, heard.append, topic.qos)

    spin_until(lambda: service.count_subscribers(topic.name) == 1)
    spin_until(lambda: peer.count_publishers(topic.name) == 1)
    spin_until(lambda: heard)  # the report to a new subscriber, which would clear later remarks

    def following() -> dict[str, Any]:
        before = service.get_clock().now()
        service.health.on_period()
        # An earlier report, to a new subscriber, may arrive later.
        spin_until(lambda: heard and Time.from_msg(heard[-1].header.stamp) >= before)
        (status,) = heard[-1].status
        return {
            "name": status.name,
            "level": status.level,
            "message": status.message,
            **{pair.key: pair.value for pair in status.values},
        }

    return following


def test_command_to_the_engines_is_followed_by_the_name_of_its_sender(
    service: ServiceNode, peer: Node, spin_until: SpinUntil
) -> None:
    heard: list[Any] = []
    for topic in (topics.ENGINES, topics.ENGINES_SENDER):
        peer.create_subscription(topic.type, topic.name, heard.append, topic.qos)
    commands: Subject[Any] = Subject()
    service.publish(topics.ENGINES, commands)
    spin_until(lambda: service.count_subscribers(topics.ENGINES_SENDER.name))
    assert len(commands.observers) == 1, "one recipe runs for both topics"
    for command in (Rejected(topics.ENGINES, "of a recipe"), "bad", topics.TURN_ON, topics.TURN_OFF):
        commands.on_next(command)
    spin_until(lambda: len(heard) == 4)

    name = service.get_name()
    assert [it.data for it in heard if isinstance(it, String)] == [topics.TURN_ON, topics.TURN_OFF]
    assert [(it.key, it.value) for it in heard if isinstance(it, KeyValue)] == [
        (topics.TURN_ON, name),
        (topics.TURN_OFF, name),
    ]


def number(data: float) -> Float64:
    return Float64(data=data)


def position(x: float, y: float) -> PointStamped:
    return PointStamped(point=Point(x=x, y=y))


GOOD_AND_BAD = [
    (
        topics.L1,
        [number(0.0), number(2.5)],
        [number(math.nan), number(math.inf), number(-math.inf), number(-1e-9)],
    ),
    (
        topics.EFFECTOR_POSITION,
        [position(-1.0, 2.0)],
        [position(math.nan, 0.0), position(0.0, math.inf)],
    ),
    (topics.OPERATOR_HEARTBEAT, [Bool(data=True)], [Bool(data=False)]),
    (topics.OPERATOR_PRESENCE, [Header()], []),
    (
        topics.ENGINES,
        [String(data="turn_on"), String(data="turn_off")],
        [String(data="Turn_on"), String(data=""), String(data="x" * 100_000)],
    ),
]


@pytest.mark.parametrize(("topic", "good", "bad"), GOOD_AND_BAD, ids=lambda value: getattr(value, "name", ""))
def test_bad_messages_are_dropped_and_reported(
    service: ServiceNode,
    peer: Node,
    spin_until: SpinUntil,
    health: Callable[[], dict[str, Any]],
    topic: topics.Topic,
    good: list[Any],
    bad: list[Any],
) -> None:
    received: list[Any] = []
    service.observe(topic).subscribe(received.append)
    publisher = peer.create_publisher(topic.type, topic.name, topic.qos)
    spin_until(lambda: publisher.get_subscription_count() == 1)

    for message in bad:
        before = service.health.dropped
        publisher.publish(message)
        spin_until(lambda before=before: service.health.dropped == before + 1)
    for message in good:
        publisher.publish(message)
        spin_until(lambda message=message: received[-1:] == [topic.value(message)])

    assert received == [topic.value(message) for message in good]
    report = health()
    assert report["dropped"] == str(len(bad))
    assert report["level"] == (DiagnosticStatus.WARN if bad else DiagnosticStatus.OK)
    if bad:
        remarks = report["message"].split("; ")
        assert remarks[0].startswith(f"{topic.name}: {topic.problem(topic.value(bad[0]))}")
        assert all(len(remark) < 200 for remark in remarks)
    following = health()
    assert (following["level"], following["message"]) == (DiagnosticStatus.OK, "running")
    assert following["dropped"] == str(len(bad))


TRUNCATED = [
    (topics.L1, number(2.5)),
    (topics.EFFECTOR_POSITION, position(-1.0, 2.0)),
    (topics.EFFECTOR_SPEED, number(0.5)),
    (topics.OPERATOR_PRESENCE, Header(frame_id="base")),
    (topics.ENGINES, String(data="turn_off")),
]


@pytest.mark.parametrize(("topic", "message"), TRUNCATED, ids=lambda value: getattr(value, "name", ""))
def test_truncated_messages_are_dropped_and_reported(
    service: ServiceNode,
    peer: Node,
    spin_until: SpinUntil,
    health: Callable[[], dict[str, Any]],
    topic: topics.Topic,
    message: Any,
) -> None:
    received: list[Any] = []
    service.observe(topic).subscribe(received.append)
    publisher = peer.create_publisher(topic.type, topic.name, topic.qos)
    spin_until(lambda: publisher.get_subscription_count() == 1)
    whole = bytes(serialize_message(message))

    for length in range(8, len(whole), 4):  # DDS pads to four octets
        before = service.health.dropped
        publisher.publish(whole[:length])
        spin_until(lambda before=before: service.health.dropped == before + 1)
    publisher.publish(whole)
    spin_until(lambda: received)

    assert received == [topic.value(message)]
    assert f"{topic.name}: cannot deserialize 8 bytes as {topic.type_name}" in health()["message"]


def test_latched_topic_receives_from_volatile_publishers_too(
    service: ServiceNode, peer: Node, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    received: list[float] = []
    service.observe(topics.L1).subscribe(received.append)
    latched = peer.create_publisher(Float64, "l1", topics.L1.qos)
    latched.publish(number(1.0))
    spin_until(lambda: received == [1.0])

    by_hand = peer.create_publisher(Float64, "l1", QoSProfile(depth=10))
    spin_until(lambda: by_hand.get_subscription_count() == 1)
    by_hand.publish(number(2.0))
    spin_until(lambda: received == [1.0, 2.0])
    spin_until(lambda: latched.get_subscription_count() == 2)
    latched.publish(number(3.0))
    spin_until(lambda: len(received) == 3)
    spin_for(0.05)

    assert received == [1.0, 2.0, 3.0]


@pytest.fixture
def speeds(service: ServiceNode) -> Subject[float | Rejected]:
    speeds: Subject[float | Rejected] = Subject()
    service.publish(topics.EFFECTOR_SPEED, speeds)
    return speeds


@pytest.fixture
def heard_speeds(
    service: ServiceNode, peer: Node, spin_until: SpinUntil, speeds: Subject[float | Rejected]
) -> list[float]:
    heard: list[float] = []
    topic = topics.EFFECTOR_SPEED
    peer.create_subscription(topic.type, topic.name, lambda message: heard.append(message.data), topic.qos)
    spin_until(lambda: service.count_subscribers(topic.name) == 1)
    (publisher,) = (each for each in service.publishers if each.topic_name == "/effector/speed")
    spin_until(publisher.get_subscription_count)
    return heard


@pytest.mark.parametrize(
    ("item", "message"),
    [
        (math.inf, "effector/speed: inf is not finite"),
        (Rejected(topics.EFFECTOR_POSITION, "it stands still"), "effector/position: it stands still"),
    ],
    ids=["bad", "rejected"],
)
def test_bad_or_rejected_item_is_reported_instead_of_published(
    speeds: Subject[float | Rejected],
    heard_speeds: list[float],
    spin_until: SpinUntil,
    health: Callable[[], dict[str, Any]],
    item: float | Rejected,
    message: str,
) -> None:
    assert health()["seconds_since_output"] == ""
    for speed in (item, 1.0, 2.0):
        speeds.on_next(speed)
    spin_until(lambda: heard_speeds == [1.0, 2.0])

    report = health()
    assert report["message"] == message
    assert (report["published"], report["dropped"]) == ("2", "1")
    assert 0 <= float(report["seconds_since_output"]) < 5


def test_topic_is_read_as_the_contract_says(service: ServiceNode, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[tuple[tuple[Any, ...], dict[str, Any]]] = []
    for kind in ("", "sampled_", "buffered_"):
        monkeypatch.setattr(
            service, f"create_{kind}observable", lambda *args, **options: read.append((args, options))
        )
    topic, ticks, on_full = topics.OPERATOR_HEARTBEAT, rx.never(), read.clear

    service.observe(topic)
    service.observe(topic, timestamped=True)
    service.observe(topic, max_age=0.5)
    service.observe_sampled(topic, ticks, timestamped=True)
    service.observe_buffered(topic, ticks, on_full)

    assert [args for args, _ in read] == [
        *3 * [(topic.type, topic.name, topic.qos)],
        *2 * [(topic.type, topic.name, ticks, topic.qos)],
    ]
    assert [options["timestamped"] for _, options in read] == [False, True, True, True, False]
    assert read[0][1]["every_publisher"]
    assert read[-1][1]["on_full"] is on_full


def test_topic_on_demand_is_published_on_demand(
    service: ServiceNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[bool] = []
    monkeypatch.setattr(service, "publish_observable", lambda *_, on_demand, **__: asked.append(on_demand))
    service.publish(topics.L1, rx.never())
    service.publish(topics.L2, rx.never(), on_demand=True)
    assert asked == [False, True]


def at_time(seconds: float) -> datetime:
    return datetime.fromtimestamp(seconds, UTC)


@pytest.mark.parametrize(
    ("age", "problem"),
    [
        (0.5, None),
        (0.501, "it is 0.501 s old"),
        (-0.5, None),
        (-10.0, "its clock is 10.000 s ahead of ours"),
    ],
)
def test_messages_that_are_not_fresh_are_dropped(
    service: ServiceNode,
    monkeypatch: pytest.MonkeyPatch,
    age: float,
    problem: str | None,
) -> None:
    received: list[Any] = []
    dropped: list[tuple[str, str]] = []
    monkeypatch.setattr(service.health, "drop", lambda *why: dropped.append(why))
    monkeypatch.setattr("interfaces.service.node.stamps.now", lambda: at_time(20.0))
    read: Subject[Timestamp[bytes]] = Subject()
    monkeypatch.setattr(service, "create_sampled_observable", lambda *_, item, **__: read.map(item))
    service.observe_sampled(topics.OPERATOR_HEARTBEAT, 0.1, max_age=0.5).subscribe(received.append)

    read.on_next(Timestamp(serialize_message(Bool(data=True)), at_time(20.0 - age)))

    assert received == [None if problem else True]
    assert dropped == ([("operator_heartbeat", problem)] if problem else [])


def test_age_is_by_the_time_of_day(service: ServiceNode) -> None:
    assert service.age(datetime.now(UTC) - timedelta(seconds=5)) == pytest.approx(5.0, abs=1.0)


def test_age_of_a_stamp_is_by_ros_time(service: ServiceNode, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(service.scheduler, "time_of_stamps", lambda: 7 * 10**9)
    assert service.stamp_age(2 * 10**9) == 5.0


def test_data_of_a_stranger_that_is_an_error_is_dropped(
    service: ServiceNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    dropped: list[tuple[str, str]] = []
    monkeypatch.setattr(service.health, "drop", lambda *why: dropped.append(why))
    service.drop("l1", ValueError("an unknown type"))
    assert dropped == [("l1", "an unknown type")]


def test_many_remarks_are_reported_as_four_reasons_and_a_count(
    service: ServiceNode, health: Callable[[], dict[str, Any]]
) -> None:
    names = [f"l{number}" for number in range(40)]
    for name in names:
        service.remark("l1", f"{name} is too much")

    report = health()

    assert report["message"].split("; ") == [
        *(f"l1: {name} is too much" for name in names[:4]),
        "l1: other reasons (36 times)",
    ]
    assert (report["level"], report["dropped"]) == (DiagnosticStatus.WARN, "0")


# Parameters


def test_parameter_has_a_description_and_a_range(service: ServiceNode) -> None:
    assert service.declare(one("rate", 20.0, (1.0, 100.0), "how often", unit="Hz")).rate == 20.0
    assert service.declare(one("strikes", 3, (1, 9), "how many")).strikes == 3

    rate, strikes = service.describe_parameters(["rate", "strikes"])

    assert (rate.description, rate.read_only) == ("how often [Hz]", True)
    assert (rate.floating_point_range[0].from_value, rate.floating_point_range[0].to_value) == (1.0, 100.0)
    assert (strikes.integer_range[0].from_value, strikes.integer_range[0].to_value) == (1, 9)
    assert strikes.description == "how many"


@pytest.mark.parametrize("value", [0.5, 100.5, math.nan, math.inf, -math.inf, "fast"])
def test_value_out_of_range_or_of_another_type_is_refused(make_node: MakeNode, value: float | str) -> None:
    node = make_node("service", kind=ServiceNode, parameter_overrides=[Parameter("rate", value=value)])
    wrong = InvalidParameterTypeException if value == "fast" else InvalidParameterValueException

    with pytest.raises(wrong, match="rate"):
        node.declare(one("rate", 20.0, (1.0, 100.0), "how often [Hz]"))


def test_parameters_are_lists_or_have_no_default(make_node: MakeNode) -> None:
    names, word = one("names", ("a", "b"), None, "of joints"), one("word", Parameter.Type.STRING, None, "")
    assert make_node("default", kind=ServiceNode).declare(names).names == ("a", "b")
    assert make_node("typed", kind=ServiceNode).declare(word).word is None
    given = [Parameter("names", value=["c"]), Parameter("word", value="y")]
    node = make_node("given", kind=ServiceNode, parameter_overrides=given)
    assert (node.declare(names).names, node.declare(word).word) == (["c"], "y")


@pytest.mark.parametrize(
    ("default", "value", "problem"),
    [
        (("a", "b"), ["y", "n"], ""),
        (("a", "b"), ["y", 1], "must be a list of strings, not ['y', 1]"),
        (("a", "b"), [], "must be a list of strings, not []"),
        (("a", "b"), "a", "must be a list of strings, not 'a'"),
        ((1.0,), [1], "must be a list of numbers with a decimal point, not [1]"),
        ((True,), [False], ""),
        ((True,), [1], "must be a list of true and false, not [1]"),
        ((1,), [1.0], "must be a list of integers, not [1.0]"),
        (Parameter.Type.INTEGER, 5, ""),
        (Parameter.Type.INTEGER, True, "must be an integer, not True"),
        (Parameter.Type.STRING, None, "must be a string, not None"),
        (1.0, {"a": 1}, "must be a number with a decimal point, not {'a': 1}"),
    ],
)
def test_a_value_has_the_type_of_its_parameter(default: object, value: object, problem: str) -> None:
    assert Declaration("x", default, None, "", "", False).problem(value) == problem


@pytest.mark.parametrize("default", [(), None, {}, b"a", (1, "a"), Parameter.Type.BYTE_ARRAY])
def test_a_parameter_has_a_type_that_files_can_hold(default: object) -> None:
    with pytest.raises(TypeError, match=r"cannot be the default of a parameter$"):
        parameter(default, None, "", "")


@pytest.mark.parametrize(
    ("default", "within"), [("b", ("a", "c")), (True, (False, True)), ((1,), ((0,), (2,)))]
)
def test_only_a_number_has_a_range(default: Any, within: tuple[Any, Any]) -> None:
    with pytest.raises(TypeError, match=r"cannot be the default of a parameter with a range$"):
        parameter(default, within, "", "")


def test_parameter_is_fixed_unless_it_is_settable() -> None:
    fields = [
        ("fixed", float, parameter(1.0, None, "", "")),
        ("free", float, parameter(1.0, None, "", "", settable=True)),
    ]
    declared = declarations(dataclasses.make_dataclass("Parameters", fields))
    assert [each.settable for each in declared] == [False, True]


def test_only_settable_parameters_can_be_set_at_run_time(service: ServiceNode) -> None:
    service.declare(one("fixed", 20.0, (1.0, 100.0), "fixed"))
    service.declare(one("value", 20.0, (1.0, 100.0), "value", settable=True))

    def set_to(name: str, value: float) -> bool:
        return bool(service.set_parameters([Parameter(name, value=value)])[0].successful)

    assert not set_to("fixed", 21.0)
    assert set_to("value", 21.0)
    assert not set_to("value", math.nan)
    assert service.get_parameter("value").value == 21.0


def test_number_that_is_not_finite_is_refused_without_a_range(service: ServiceNode) -> None:
    service.declare(one("value", 20.0, None, "value", settable=True))

    (result,) = service.set_parameters([Parameter("value", value=math.inf)])

    assert (result.successful, result.reason) == (False, "inf is not finite")
