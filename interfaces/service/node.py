"""A node that speaks the contract (:mod:`interfaces.topics`)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from reactivex import Observable, abc
from reactivex.disposable import CompositeDisposable

from interfaces.service.health import HealthReporter
from interfaces.service.parameters import Declaration, declarations
from interfaces.topics import Topic, is_latched
from reactive_node import ReactiveNode, stamps
from reactive_node.stamps import Timestamp

T = TypeVar("T")
_RECENT = 16  # messages of which a second reader may deliver a copy


@dataclass(frozen=True, eq=False)
class Rejected:
    """
    An input that a recipe rejects: the recipe emits this, and :meth:`ServiceNode.publish` reports it.

    No two are equal, so that ``distinct_until_changed`` keeps each of them.
    """

    topic: Topic
    """The topic of the input."""
    reason: str


class ServiceNode(ReactiveNode):
    """A node that speaks the contract, drops bad messages, and reports its health."""

    def __init__(self, node_name: str, **options: Any) -> None:
        """Create the node of a service; the options are those of :class:`rclpy.node.Node`."""
        super().__init__(node_name, **options)
        self._observed: dict[str, Topic] = {}  # by its resolved name
        self.health = HealthReporter(self, before_report=self._remark_other_types)
        self.add_on_set_parameters_callback(_only_finite)

    def declare(self, parameters: type[T]) -> T:
        """
        Declare the parameters of a dataclass (:mod:`interfaces.service.parameters`) and return their values.

        :raises ParameterException: if a value that the user gave has the wrong type or is out of range.
        """
        values = {each.name: self._declare(each) for each in declarations(parameters)}
        return parameters(**values)

    def _declare(self, declaration: Declaration) -> Any:
        name, default, within, unit, meaning, settable = declaration
        description = f"{meaning} [{unit}]" if unit else meaning
        descriptor = ParameterDescriptor(description=description, read_only=not settable)
        if within is not None and isinstance(default, float):
            descriptor.floating_point_range = [FloatingPointRange(from_value=within[0], to_value=within[1])]
        elif within is not None:
            descriptor.integer_range = [IntegerRange(from_value=within[0], to_value=within[1])]
        return self.declare_parameter(name, default, descriptor).value

    def observe(
        self,
        topic: Topic,
        *,
        timestamped: bool = False,
        sampled: float | None = None,
        max_age: float | None = None,
    ) -> Observable[Any]:
        """
        Return the good messages of a topic; the others are dropped and reported.

        :param timestamped: see :meth:`ReactiveNode.create_observable`.
        :param sampled: the same; not for a latched topic.
        :param max_age: a message that is older [s], or this much ahead of the local clock, is not good.
        """
        self._observed[self.resolve_topic_name(topic.name)] = topic
        samples = (
            self._from_every_publisher(topic)
            if is_latched(topic.qos)
            else self._samples(topic, topic.qos, sampled=sampled)
        )

        def read(sample: Timestamp[bytes]) -> Any | None:
            message = self._read(topic, sample, max_age)
            return Timestamp(message, sample.timestamp) if timestamped and message is not None else message

        return samples.map(read).filter(lambda item: item is not None)

    def _samples(self, topic: Topic, qos: QoSProfile, **options: Any) -> Observable[Timestamp[bytes]]:
        """
        Return the messages of a reader as they came.

        rclpy on Cyclone DDS would deliver a truncated message as one of zeros.
        """
        return self.create_observable(topic.type, topic.name, qos, timestamped=True, raw=True, **options)

    def _read(self, topic: Topic, sample: Timestamp[bytes], max_age: float | None) -> Any | None:
        """Return the message of a sample; ``None`` if it is not good, which is reported."""
        try:
            message = deserialize_message(sample.value, topic.type)
        except RuntimeError:  # RMWError, which the rclpy of ROS 2 does not export
            self.health.drop(topic.name, f"{len(sample.value)} octets are no {topic.type_name}")
            return None
        is_good = self._is_good(topic, message) and (
            max_age is None or self._is_fresh(topic, sample.timestamp, max_age)
        )
        return message if is_good else None

    def _from_every_publisher(self, topic: Topic) -> Observable[Timestamp[bytes]]:
        """
        Return the samples of a latched topic, also those of publishers that are not latched.

        A transient-local reader receives nothing from a volatile publisher, such as ``ros2 topic pub``; if
        there is one, a volatile reader listens as well.
        """

        def subscribe(
            observer: abc.ObserverBase[Timestamp[bytes]], scheduler: abc.SchedulerBase | None = None
        ) -> abc.DisposableBase:
            readers = CompositeDisposable()
            recent: deque[datetime] = deque(maxlen=_RECENT)
            has_volatile_reader = False

            def forward(sample: Timestamp[bytes]) -> None:
                if sample.timestamp not in recent:
                    recent.append(sample.timestamp)
                    observer.on_next(sample)

            def add(qos: QoSProfile, **options: Any) -> None:
                samples = self._samples(topic, qos, **options)
                readers.add(samples.subscribe(forward, observer.on_error, observer.on_completed))

            def on_incompatible_qos(_: Any) -> None:
                nonlocal has_volatile_reader
                if not has_volatile_reader:
                    has_volatile_reader = True
                    add(QoSProfile(depth=topic.qos.depth, durability=DurabilityPolicy.VOLATILE))

            add(topic.qos, event_callbacks=SubscriptionEventCallbacks(incompatible_qos=on_incompatible_qos))
            return readers

        return Observable(subscribe)

    def publish(
        self,
        topic: Topic,
        items: Observable[Any],
        message: Callable[[Any], Any] = lambda item: item,
    ) -> None:
        """
        Publish items on a topic. Bad messages and items that are :class:`Rejected` are dropped and reported.

        :param message: makes a message of an item.
        """

        def good_message(item: Any) -> Any | None:
            if isinstance(item, Rejected):
                self.health.drop(item.topic.name, item.reason)
                return None
            result = message(item)
            if not self._is_good(topic, result):
                return None
            self.health.count_output()
            return result

        messages = items.map(good_message).filter(lambda message: message is not None)
        self.publish_observable(messages, topic.type, topic.name, topic.qos)

    def age(self, stamp: datetime) -> float:
        """
        Return how long ago a source time or stamp is [s]; negative if its clock is ahead of the local one.

        Stamps are in the time of day, even while ROS time is simulated. This clock may be set, and differs
        between hosts: safety takes only the age at arrival from it, and counts on by the Rx clock.
        """
        return (stamps.now() - stamp).total_seconds()

    def remark(self, subject: str, reason: str) -> None:
        """Make the next health report a warning with this reason."""
        self.health.remark(subject, reason)

    def _is_good(self, topic: Topic, message: Any) -> bool:
        problem = topic.problem(message)
        if problem:
            self.health.drop(topic.name, problem)
        return not problem

    def _is_fresh(self, topic: Topic, stamp: datetime, max_age: float) -> bool:
        age = self.age(stamp)
        if abs(age) > max_age:
            problem = f"it is {age:.3f} s old" if age > 0 else f"its clock is {-age:.3f} s ahead of ours"
            self.health.drop(topic.name, problem)
        return abs(age) <= max_age

    def _remark_other_types(self) -> None:
        """Remark publishers that use an observed topic with another type: nothing arrives from them."""
        types = dict(self.get_topic_names_and_types())
        for name, topic in self._observed.items():
            if types.get(name) == [topic.type_name]:  # to ask for each topic's publishers would cost more
                continue
            for publisher in self.get_publishers_info_by_topic(name):
                if publisher.topic_type != topic.type_name:
                    self.remark(topic.name, f"{publisher.node_name} publishes {publisher.topic_type}")


def _only_finite(parameters: list[Parameter]) -> SetParametersResult:
    for parameter in parameters:
        if isinstance(parameter.value, float) and not math.isfinite(parameter.value):
            return SetParametersResult(successful=False, reason=f"{parameter.value} is not finite")
    return SetParametersResult(successful=True)
