"""Topics as observables, observables as topics (thesis chapter 4)."""

from __future__ import annotations

import threading
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
import reactivex as rx
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile
from reactivex import operators as ops
from reactivex.abc import DisposableBase
from reactivex.subject import Subject
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool

from reactive_node import ReactiveNode
from reactive_node.stamps import Timestamp

Make = Callable[..., Any]
SpinUntil = Callable[..., None]
SpinFor = Callable[[float], None]

LATCHED = QoSProfile(depth=3, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def node(make_node: Make) -> ReactiveNode:
    node: ReactiveNode = make_node("reactive")
    return node


@pytest.fixture
def peer(make_node: Make) -> Node:
    """An ordinary node of somebody else."""
    peer: Node = make_node("peer", kind=Node)
    return peer


class Talker:
    """Publishes numbered strings on a topic."""

    def __init__(self, peer: Node, spin_until: SpinUntil, qos: QoSProfile | int = 10) -> None:
        self.publisher: Publisher = peer.create_publisher(String, "topic", qos)
        self.spin_until = spin_until

    def say(self, *texts: str) -> None:
        for text in texts:
            self.publisher.publish(String(data=text))

    def say_when_heard(self, *texts: str, readers: int = 1) -> None:
        self.spin_until(lambda: self.publisher.get_subscription_count() == readers)
        self.say(*texts)


@pytest.fixture
def talker(peer: Node, spin_until: SpinUntil) -> Talker:
    return Talker(peer, spin_until)


@pytest.fixture
def latched_talker(peer: Node, spin_until: SpinUntil) -> Talker:
    return Talker(peer, spin_until, LATCHED)


def texts_into(received: list[str]) -> Callable[[Any], None]:
    return lambda message: received.append(message.data)


# The listings of the thesis


def test_listing_4_1_and_4_2_a_node_creates_subscriptions(
    peer: Node, talker: Talker, spin_until: SpinUntil
) -> None:
    received: list[str] = []
    peer.create_subscription(String, "topic", texts_into(received), 10)

    talker.say_when_heard("hello")

    spin_until(lambda: received == ["hello"])


def test_listing_4_3_a_reactive_node_takes_the_place_of_a_node(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil
) -> None:
    received: list[str] = []
    assert isinstance(node, Node)
    node.create_subscription(String, "topic", texts_into(received), 10)

    talker.say_when_heard("hello")

    spin_until(lambda: received == ["hello"])


def test_listing_4_4_an_observable_is_created_like_a_subscription_without_a_callback(
    node: ReactiveNode,
) -> None:
    assert isinstance(node.create_observable(String, "topic"), rx.Observable)


def test_listing_4_5_and_4_6_three_callbacks_receive_messages_and_the_end(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil
) -> None:
    received: list[str] = []
    errors: list[Exception] = []
    completed: list[bool] = []

    observable = node.create_observable(String, "topic")
    observable.subscribe(texts_into(received), errors.append, lambda: completed.append(True))
    talker.say_when_heard("one", "two")
    spin_until(lambda: received == ["one", "two"])
    node.destroy_node()

    assert (errors, completed) == ([], [True])


# Cold and shared


def test_nothing_is_on_the_network_before_the_first_observer_subscribes(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    observable = node.create_observable(String, "topic")
    spin_for(0.2)
    assert talker.publisher.get_subscription_count() == 0
    assert not [sub for sub in node.subscriptions if sub.topic_name == "/topic"]

    observable.subscribe()
    spin_until(lambda: talker.publisher.get_subscription_count() == 1)


def test_all_observers_share_one_reader_and_the_last_one_ends_it(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    received: dict[int, list[str]] = {0: [], 1: [], 2: []}
    observable = node.create_observable(String, "topic")
    subscriptions = [observable.subscribe(texts_into(received[n])) for n in received]

    talker.say_when_heard("all")
    spin_until(lambda: all(received.values()))
    spin_for(0.05)
    assert talker.publisher.get_subscription_count() == 1
    subscriptions[0].dispose()
    talker.say("two of us")
    spin_until(lambda: len(received[2]) == 2)
    subscriptions[1].dispose()
    subscriptions[2].dispose()
    spin_until(lambda: talker.publisher.get_subscription_count() == 0)

    assert received == {0: ["all"], 1: ["all", "two of us"], 2: ["all", "two of us"]}


def test_subscribing_again_makes_a_new_reader(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil
) -> None:
    observable = node.create_observable(String, "topic")
    received: list[str] = []
    for text in ("first", "second"):
        subscription = observable.subscribe(texts_into(received))
        talker.say_when_heard(text)
        spin_until(lambda text=text: received[-1:] == [text])
        subscription.dispose()
        subscription.dispose()
        spin_until(lambda: talker.publisher.get_subscription_count() == 0)

    assert received == ["first", "second"]


def test_a_further_observer_of_a_latched_topic_gets_what_was_retained_like_one_with_a_reader_of_its_own(
    node: ReactiveNode, latched_talker: Talker, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    shared, own = (node.create_observable(String, "topic", LATCHED) for _ in range(2))
    first: list[str] = []
    late: list[str] = []
    late_with_own: list[str] = []
    latched_talker.say("0", "1", "2", "3")
    shared.subscribe(texts_into(first))
    spin_until(lambda: first == ["1", "2", "3"])
    latched_talker.say("4")
    spin_until(lambda: first[-1] == "4")

    shared.subscribe(texts_into(late))
    own.subscribe(texts_into(late_with_own))
    assert late == []  # on the executor, as all messages
    spin_until(lambda: len(late) == 3 and len(late_with_own) == 3)
    latched_talker.say("5")
    spin_until(lambda: late[-1] == "5" and late_with_own[-1] == "5")
    spin_for(0.05)

    assert late == late_with_own == ["2", "3", "4", "5"]
    assert first == ["1", "2", "3", "4", "5"]


def test_what_was_retained_dies_with_its_publisher(
    node: ReactiveNode, peer: Node, latched_talker: Talker, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    observable = node.create_observable(String, "topic", LATCHED)
    first: list[str] = []
    late: list[str] = []
    observable.subscribe(texts_into(first))
    latched_talker.say("0")
    spin_until(lambda: first == ["0"])

    peer.destroy_publisher(latched_talker.publisher)
    spin_until(lambda: node.count_publishers("topic") == 0)
    observable.subscribe(texts_into(late))
    spin_for(0.1)

    assert late == []


def test_a_new_reader_has_not_kept_what_the_one_before_had(
    node: ReactiveNode, latched_talker: Talker, spin_until: SpinUntil
) -> None:
    deep = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    observable = node.create_observable(String, "topic", deep)
    latched_talker.say("0", "1")
    for _ in range(2):
        first: list[str] = []
        late: list[str] = []
        subscriptions = [observable.subscribe(texts_into(first))]
        spin_until(lambda first=first: first == ["0", "1"])
        subscriptions.append(observable.subscribe(texts_into(late)))
        spin_until(lambda late=late: late == ["0", "1"])
        for subscription in subscriptions:
            subscription.dispose()


def test_a_further_observer_of_a_volatile_topic_gets_what_comes(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil
) -> None:
    observable = node.create_observable(String, "topic")
    first: list[str] = []
    late: list[str] = []
    observable.subscribe(texts_into(first))
    talker.say_when_heard("0")
    spin_until(lambda: first == ["0"])

    observable.subscribe(texts_into(late))
    talker.say("1")
    spin_until(lambda: late)

    assert (first, late) == (["0", "1"], ["1"])


def test_an_observer_that_leaves_before_it_got_what_was_retained_gets_nothing(
    node: ReactiveNode, latched_talker: Talker, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    observable = node.create_observable(String, "topic", LATCHED)
    first: list[str] = []
    late: list[str] = []
    observable.subscribe(texts_into(first))
    latched_talker.say("0")
    spin_until(lambda: first)

    observable.subscribe(texts_into(late)).dispose()
    spin_for(0.05)

    assert late == []


def test_timestamped_items_carry_the_source_time(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil
) -> None:
    received: list[Timestamp[String]] = []
    node.create_observable(String, "topic", timestamped=True).subscribe(received.append)

    before = datetime.now(UTC)
    talker.say_when_heard("hello")
    after = datetime.now(UTC)
    spin_until(lambda: received)

    assert received[0].value == String(data="hello")
    assert before - timedelta(microseconds=1) <= received[0].timestamp <= after


def test_a_node_that_ended_completes_whoever_comes_late(node: ReactiveNode) -> None:
    observable = node.create_observable(String, "topic")
    node.destroy_node()
    node.destroy_node()
    completed: list[bool] = []

    observable.subscribe(on_completed=lambda: completed.append(True))

    assert completed == [True]


def test_what_is_no_message_type_is_an_error_of_the_observable(node: ReactiveNode) -> None:
    errors: list[Exception] = []

    node.create_observable(int, "topic").subscribe(on_error=errors.append)

    assert len(errors) == 1


# Disposing anywhere


def test_disposing_inside_the_callback_is_the_last_message(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    received: list[str] = []
    subscription: DisposableBase

    def take(message: String) -> None:
        received.append(message.data)
        subscription.dispose()

    subscription = node.create_observable(String, "topic").subscribe(take)
    talker.say_when_heard("0", "1", "2")
    spin_until(lambda: talker.publisher.get_subscription_count() == 0)
    spin_for(0.05)

    assert received == ["0"]


def test_disposing_and_subscribing_a_thousand_times_under_traffic_on_another_thread_is_safe(
    node: ReactiveNode, latched_talker: Talker, spin_until: SpinUntil
) -> None:
    observable = node.create_observable(String, "topic", LATCHED)
    kept = observable.subscribe()
    node.create_timer(0.0005, lambda: latched_talker.say("noise"))
    done = threading.Event()
    errors: list[BaseException] = []

    def churn() -> None:
        try:
            for round_ in range(500):
                subscription = observable.subscribe(lambda _: None)
                if round_ % 5 == 0:
                    kept_for_a_while = node.create_observable(String, "topic").subscribe(lambda _: None)
                    kept_for_a_while.dispose()
                subscription.dispose()
        except BaseException as error:
            errors.append(error)
        finally:
            done.set()

    threads = [threading.Thread(target=churn) for _ in range(2)]
    for thread in threads:
        thread.start()
    spin_until(lambda: not any(thread.is_alive() for thread in threads), seconds=30)
    kept.dispose()

    assert errors == []
    assert not [sub for sub in node.subscriptions if sub.topic_name == "/topic"]


# Errors


def test_an_error_in_an_observer_ends_the_spinning(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil
) -> None:
    def fail(message: String) -> None:
        raise ValueError(message.data)

    node.create_observable(String, "topic").subscribe(fail)

    talker.say_when_heard("planted")
    with pytest.raises(ValueError, match="planted"):
        spin_until(lambda: False)


def test_an_error_in_an_operator_without_an_observer_for_errors_ends_the_spinning(
    node: ReactiveNode, talker: Talker, spin_until: SpinUntil
) -> None:
    node.create_observable(String, "topic").map(lambda message: 1 / 0).subscribe()

    talker.say_when_heard("boom")
    with pytest.raises(ZeroDivisionError):
        spin_until(lambda: False)


# Publishing


def test_an_observable_is_published(node: ReactiveNode, peer: Node, spin_until: SpinUntil) -> None:
    numbers: Subject[float] = Subject()
    received: list[float] = []
    peer.create_subscription(Float64, "numbers", lambda message: received.append(message.data), 10)
    node.publish_observable(numbers.map(lambda number: Float64(data=number)), Float64, "numbers")

    spin_until(lambda: node.count_subscribers("numbers") == 1)
    spin_until(lambda: peer.count_publishers("numbers") == 1)
    spin_until(lambda: any(p.get_subscription_count() for p in node.publishers if p.topic_name == "/numbers"))
    numbers.on_next(1.5)
    spin_until(lambda: received == [1.5])


def test_the_publisher_is_there_from_wiring_time_on_and_leaves_with_its_disposable(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    sink = node.publish_observable(rx.never(), Float64, "numbers")
    spin_until(lambda: peer.count_publishers("numbers") == 1)

    sink.dispose()
    sink.dispose()
    spin_until(lambda: peer.count_publishers("numbers") == 0)


def test_recipes_run_on_the_scheduler_of_the_node(node: ReactiveNode, spin_until: SpinUntil) -> None:
    threads: list[int] = []

    def message(number: int) -> Float64:
        threads.append(threading.get_ident())
        return Float64(data=float(number))

    node.publish_observable(rx.interval(0.001).map(message), Float64, "numbers")
    spin_until(lambda: len(threads) >= 3)

    assert set(threads) == {threading.get_ident()}


@pytest.mark.parametrize(
    "recipe",
    [
        rx.throw(ValueError("planted")),
        rx.timer(0.01).map(lambda _: int("planted")),
        rx.timer(0.01).flat_map(lambda _: rx.of(1).map(lambda _: int("planted"))),
        rx.timer(0.01).map(lambda _: rx.throw(ValueError("planted"))).switch_latest(),
    ],
)
def test_an_error_in_a_recipe_ends_the_spinning(
    node: ReactiveNode, spin_until: SpinUntil, recipe: rx.Observable[Any]
) -> None:
    node.publish_observable(recipe, Float64, "numbers")

    with pytest.raises(ValueError, match="planted"):
        spin_until(lambda: False)


def test_what_is_no_message_of_the_topic_ends_the_spinning(node: ReactiveNode, spin_until: SpinUntil) -> None:
    node.publish_observable(rx.timer(0.01).map(lambda _: String(data="no number")), Float64, "numbers")

    with pytest.raises(TypeError):
        spin_until(lambda: False)


def test_the_end_of_the_node_ends_what_it_publishes(node: ReactiveNode) -> None:
    numbers: Subject[Float64] = Subject()
    node.publish_observable(numbers, Float64, "numbers")

    node.destroy_node()
    numbers.on_next(Float64(data=1.0))


# Parameters


def test_a_parameter_is_an_observable_of_its_value_and_of_each_that_is_set(node: ReactiveNode) -> None:
    node.declare_parameter("gain", 1.0)
    node.declare_parameter("other", 1.0)
    gains: list[float] = []
    subscription = node.create_parameter_observable("gain").subscribe(gains.append)

    node.set_parameters([Parameter("gain", value=2.0)])
    node.set_parameters([Parameter("other", value=9.0)])
    node.set_parameters_atomically([Parameter("other", value=8.0), Parameter("gain", value=3.0)])
    node.set_parameters([Parameter("gain", value="wrong type")])
    subscription.dispose()
    node.set_parameters([Parameter("gain", value=4.0)])

    assert gains == [1.0, 2.0, 3.0]


def test_two_observers_of_a_parameter_agree_though_one_of_them_sets_it(node: ReactiveNode) -> None:
    node.declare_parameter("speed", 1.0)
    seen: dict[str, list[float]] = {"obedient": [], "bounded": []}

    def bound(value: float) -> None:
        seen["bounded"].append(value)
        if value > 2.0:
            node.set_parameters([Parameter("speed", value=2.0)])

    speed = node.create_parameter_observable("speed")
    speed.subscribe(seen["obedient"].append)
    speed.subscribe(bound)
    node.set_parameters([Parameter("speed", value=5.0)])

    assert node.get_parameter("speed").value == 2.0
    assert [values[-1] for values in seen.values()] == [2.0, 2.0]


def test_an_observer_may_set_the_parameter_when_it_gets_the_present_value(node: ReactiveNode) -> None:
    node.declare_parameter("gain", 1.0)
    gains: list[float] = []

    def double(gain: float) -> None:
        gains.append(gain)
        if len(gains) == 1:
            node.set_parameters([Parameter("gain", value=2 * gain)])

    node.create_parameter_observable("gain").subscribe(double)

    assert gains == [1.0, 2.0]


def test_a_parameter_set_on_another_thread_while_the_present_value_is_read_is_not_missed(
    node: ReactiveNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    node.declare_parameter("gain", 1.0)
    get = node.get_parameter
    setter = threading.Thread(target=lambda: node.set_parameters([Parameter("gain", value=2.0)]))

    def get_too_early(name: str) -> Parameter:
        present = get(name)
        setter.start()
        while setter.is_alive() and get(name).value == present.value:
            setter.join(0.001)
        return present

    gains: list[float] = []
    with monkeypatch.context() as patch:
        patch.setattr(node, "get_parameter", get_too_early)
        node.create_parameter_observable("gain").subscribe(gains.append)
    setter.join(10)

    assert gains == [1.0, 2.0]


def test_a_parameter_that_is_not_declared_is_an_error_of_the_observable(node: ReactiveNode) -> None:
    errors: list[Exception] = []
    node.create_parameter_observable("gain").subscribe(on_error=errors.append)
    node.declare_parameter("gain", 1.0)
    node.set_parameters([Parameter("gain", value=2.0)])

    assert [type(error) for error in errors] == [ParameterNotDeclaredException]


def test_a_parameter_observable_completes_with_the_node(node: ReactiveNode) -> None:
    node.declare_parameter("gain", 1.0)
    completed: list[bool] = []
    node.create_parameter_observable("gain").subscribe(on_completed=lambda: completed.append(True))

    node.destroy_node()

    assert completed == [True]


# Calls


def answer(request: Any, response: Any) -> Any:
    response.success = request.data
    response.message = "answered"
    return response


def test_a_call_is_an_observable_of_its_response(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    peer.create_service(SetBool, "switch", answer)
    call = node.create_call(SetBool, "switch", timeout=10.0)
    requests: Subject[SetBool.Request] = Subject()
    responses: list[tuple[bool, str]] = []
    requests.flat_map(call).subscribe(lambda response: responses.append((response.success, response.message)))

    requests.on_next(SetBool.Request(data=True))
    spin_until(lambda: responses == [(True, "answered")])
    requests.on_next(SetBool.Request(data=False))
    spin_until(lambda: responses == [(True, "answered"), (False, "answered")])


def test_a_call_waits_for_a_server_without_blocking_anything(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    ticks: list[int] = []
    responses: list[Any] = []
    node.create_call(SetBool, "switch")(SetBool.Request()).subscribe(responses.append)
    rx.interval(0.01).subscribe(ticks.append, scheduler=node.scheduler)

    spin_until(lambda: len(ticks) > 10)
    assert responses == []
    peer.create_service(SetBool, "switch", answer)

    spin_until(lambda: responses)


def test_a_call_waits_for_a_server_though_simulated_time_stands_still(
    make_node: Make, peer: Node, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    node = make_node("simulated", parameter_overrides=[Parameter("use_sim_time", value=True)])
    responses: list[Any] = []
    node.create_call(SetBool, "unpause", timeout=1.0)(SetBool.Request()).subscribe(responses.append)
    spin_for(0.1)

    peer.create_service(SetBool, "unpause", answer)
    spin_until(lambda: responses)


def test_a_call_that_gets_no_response_ends_in_a_timeout(node: ReactiveNode, spin_until: SpinUntil) -> None:
    errors: list[Exception] = []
    call = node.create_call(SetBool, "nowhere", timeout=0.1)

    call(SetBool.Request()).subscribe(on_error=errors.append)
    spin_until(lambda: errors)

    assert isinstance(errors[0], TimeoutError)
    assert str(errors[0]) == "no response of nowhere within 0.1 s"


def test_a_call_with_something_else_than_a_request_is_an_error(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    peer.create_service(SetBool, "switch", answer)
    errors: list[Exception] = []

    node.create_call(SetBool, "switch")("no request").subscribe(on_error=errors.append)
    spin_until(lambda: errors)

    assert isinstance(errors[0], TypeError)


def test_a_call_that_is_given_up_gets_nothing(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    served: list[bool] = []

    def serve(request: Any, response: Any) -> Any:
        served.append(True)
        call.dispose()
        return response

    peer.create_service(SetBool, "switch", serve)
    responses: list[Any] = []
    call = node.create_call(SetBool, "switch")(SetBool.Request()).subscribe(responses.append)
    spin_until(lambda: served)
    spin_for(0.05)

    assert responses == []


def test_a_call_completes_with_the_node(node: ReactiveNode) -> None:
    completed: list[bool] = []
    node.create_call(SetBool, "nowhere")(SetBool.Request()).subscribe(
        on_completed=lambda: completed.append(True)
    )

    node.destroy_node()

    assert completed == [True]


# QoS events


def test_a_missed_deadline_is_an_event(node: ReactiveNode, peer: Node, spin_until: SpinUntil) -> None:
    qos = QoSProfile(depth=1, deadline=Duration(seconds=0.1))
    missed: list[int] = []
    events = node.create_event_observable(String, "topic", qos, "deadline")
    subscription = events.subscribe(lambda info: missed.append(info.total_count))

    publisher = peer.create_publisher(String, "topic", qos)
    spin_until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(String(data="once"))
    spin_until(lambda: missed[-1:] >= [1])
    subscription.dispose()
    spin_until(lambda: publisher.get_subscription_count() == 0)


def test_a_publisher_that_is_not_alive_is_an_event(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    qos = QoSProfile(
        depth=1,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
        liveliness_lease_duration=Duration(seconds=0.2),
    )
    alive: list[int] = []
    events = node.create_event_observable(String, "topic", qos, "liveliness")
    events.subscribe(lambda info: alive.append(info.alive_count))

    publisher = peer.create_publisher(String, "topic", qos)
    spin_until(lambda: publisher.get_subscription_count() == 1)
    # More than once: what is told is how it is when it is told, and 0.2 s are soon over.
    spin_until(lambda: publisher.assert_liveliness() or alive[-1:] == [1])
    spin_until(lambda: alive[-1:] == [0])


def test_what_happens_to_a_publisher_is_an_observable_too(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil
) -> None:
    qos = QoSProfile(depth=1, deadline=Duration(seconds=0.1))
    missed, matched = Subject[Any](), Subject[Any]()
    events: list[str] = []
    missed.pipe(ops.take(1)).subscribe(lambda _: events.append("missed"))
    matched.pipe(ops.take(1)).subscribe(lambda info: events.append(f"matched {info.current_count}"))
    callbacks = PublisherEventCallbacks(deadline=missed.on_next, matched=matched.on_next)
    node.publish_observable(rx.just(String(data="once")), String, "topic", qos, event_callbacks=callbacks)

    peer.create_subscription(String, "topic", lambda _: None, qos)

    spin_until(lambda: sorted(events) == ["matched 1", "missed"])
