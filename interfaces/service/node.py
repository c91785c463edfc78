"""A node that speaks the contract (:mod:`interfaces.topics`)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from reactivex import Observable

from interfaces.service.errors import UserError
from interfaces.service.health import HealthReporter
from interfaces.service.parameters import Declaration, declarations
from interfaces.topics import ENGINES, TURN_OFF, Topic
from reactive_node import ReactiveNode, stamps

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Rejected:
    """An input that a recipe rejects: the recipe emits this, and :meth:`ServiceNode.publish` reports it.

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
        self.health = HealthReporter(self, before_report=self._look)
        self.add_on_set_parameters_callback(_only_finite)

    def declare(self, parameters: type[T]) -> T:
        """Declare a dataclass's parameters (:mod:`interfaces.service.parameters`), and return their values.

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
        value = self.declare_parameter(name, default, descriptor).value
        # A record tells the parameters of a process by its health. Paths differ from machine to machine.
        if within is not None and value != default and not settable:
            self.health.note_parameter(name, value)
        return value

    def observe(
        self,
        topic: Topic,
        *,
        timestamped: bool = False,
        max_age: float | None = None,
    ) -> Observable[Any]:
        """Return the good values of a topic (:attr:`Topic.value`); the others are dropped and reported.

        :param timestamped: see :meth:`ReactiveNode.create_observable`.
        :param max_age: a message that is older [s], or this much ahead of the local clock, is not good.
        """
        options = self._reading(topic, timestamped, max_age)
        return self.create_observable(topic.type, topic.name, topic.qos, every_publisher=True, **options)

    def observe_sampled(
        self,
        topic: Topic,
        ticks: float | Observable[Any],
        *,
        timestamped: bool = False,
        max_age: float | None = None,
    ) -> Observable[Any]:
        """Return the newest value at each tick, if it is good; the topic must not be latched.

        See :meth:`ReactiveNode.create_sampled_observable` and, for ``max_age``, :meth:`observe`.
        """
        options = self._reading(topic, timestamped, max_age)
        return self.create_sampled_observable(topic.type, topic.name, ticks, topic.qos, **options)

    def observe_buffered(
        self, topic: Topic, ticks: float | Observable[Any], on_full: Callable[[], Any] = lambda: None
    ) -> Observable[Any]:
        """Return all good values at each tick: see :meth:`ReactiveNode.create_buffered_observable`."""
        options = self._reading(topic, False, None) | {"on_full": on_full}
        return self.create_buffered_observable(topic.type, topic.name, ticks, topic.qos, **options)

    def _reading(self, topic: Topic, timestamped: bool, max_age: float | None) -> dict[str, Any]:
        """Return the options of an observable of the good values of a topic."""
        self._observed[self.resolve_topic_name(topic.name)] = topic

        type_, value_of, problem_of = topic.type, topic.value, topic.problem
        with_time = timestamped or max_age is not None

        def good(received: Any) -> Any:
            """Return the value of a message. All in one step: every message takes this path."""
            data = received.value if with_time else received
            try:
                value = value_of(deserialize_message(data, type_))
            except RuntimeError:  # RMWError, which the rclpy of ROS 2 does not export
                self.health.drop(topic.name, f"{len(data)} octets are no {topic.type_name}")
                return None
            problem = problem_of(value)
            if not problem and max_age is not None:
                problem = self._staleness(max_age, received.timestamp)
            if problem:
                self.health.drop(topic.name, problem)
                return None
            return received._replace(value=value) if timestamped else value

        # Raw: rclpy on Cyclone DDS would deliver a truncated message as one of zeros.
        return {"timestamped": with_time, "item": good, "raw": True}

    def publish(
        self,
        topic: Topic,
        values: Observable[Any],
        *,
        on_demand: bool = False,
    ) -> None:
        """Publish values on a topic (:attr:`Topic.message`); drop and report bad ones and :class:`Rejected`.

        :param on_demand: see :meth:`ReactiveNode.publish_observable`.
        """

        message_of, problem_of = topic.message, topic.problem
        commands_engines = topic is ENGINES

        def message(value: Any) -> Any:
            if isinstance(value, Rejected):
                self.health.drop(value.topic.name, value.reason)
                return None
            problem = problem_of(value)
            if problem:
                self.health.drop(topic.name, problem)
                return None
            self.health.count_output()
            if commands_engines and value == TURN_OFF:
                self.health.note_turn_off()
            return message_of(value)

        self.publish_observable(
            values, topic.type, topic.name, topic.qos, message=message, on_demand=on_demand
        )

    def age(self, stamp: datetime) -> float:
        """Return how long ago a source time or stamp is [s]; negative if its clock is ahead of the local one.

        Stamps are in the time of day, even while ROS time is simulated. This clock may be set, and differs
        between hosts: safety takes only the age at arrival from it, and counts on by the Rx clock.
        """
        return (stamps.now() - stamp).total_seconds()

    def _staleness(self, max_age: float, stamp: datetime) -> str:
        """Return why a source time is too old [s], or too much ahead; empty if it is neither."""
        age = self.age(stamp)
        if abs(age) <= max_age:
            return ""
        return f"it is {age:.3f} s old" if age > 0 else f"its clock is {-age:.3f} s ahead of ours"

    def remark(self, subject: str, reason: str) -> None:
        self.health.remark(subject, reason)

    def _look(self) -> None:
        """Remark what is wrong; end the service with its keys, for no other hears it any longer."""
        self._remark_other_types()
        if (keys := self.health.keys) and (now := datetime.now(UTC)) >= keys.end:
            raise UserError(keys.problem(now))

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
