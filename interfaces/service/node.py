"""A node that speaks the contract (:mod:`interfaces.topics`)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from typing import Any, TypeVar

import reactivex as rx
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.parameter import Parameter
from reactivex import Observable

from interfaces.service.errors import UserError
from interfaces.service.health import HealthReporter
from interfaces.service.parameters import Declaration, declarations
from interfaces.service.peers import Peers, real_name
from interfaces.service.reading import not_fresh, reading
from interfaces.topics import ENGINES, ENGINES_SENDER, Sender, Topic
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
        self.peers = Peers(self)
        """The others on its topics and services."""
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
        if within is not None and declaration.type is Parameter.Type.DOUBLE:
            descriptor.floating_point_range = [FloatingPointRange(from_value=within[0], to_value=within[1])]
        elif within is not None:
            descriptor.integer_range = [IntegerRange(from_value=within[0], to_value=within[1])]
        value = self.declare_parameter(name, default, descriptor).value
        # A record has the parameters of a process in its health. Paths differ from machine to machine.
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
        return self.create_buffered_observable(
            topic.type, topic.name, ticks, topic.qos, on_full=on_full, **self._reading(topic)
        )

    def _reading(
        self, topic: Topic, timestamped: bool = False, max_age: float | None = None
    ) -> dict[str, Any]:
        """Return the options of an observable of the good values of a topic."""
        self.peers.reads(topic)
        staleness = None if max_age is None else partial(self._staleness, max_age)
        named = replace(topic, name=real_name(self, topic))
        return reading(named, self.health.drop, timestamped=timestamped, staleness=staleness)

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
        if topic is ENGINES:
            values = values.share()
        self.peers.writes(topic)
        message_of, problem_of, name = topic.message, topic.problem, real_name(self, topic)

        def message(value: Any) -> Any:
            if isinstance(value, Rejected):
                self.reject(value)
                return None
            problem = problem_of(value)
            if problem:
                self.health.drop(name, problem)
                return None
            self.health.count_output()
            return message_of(value)

        self.publish_observable(
            values, topic.type, topic.name, topic.qos, message=message, on_demand=on_demand
        )
        if topic is ENGINES:  # after the command, which nothing may delay
            commands = values.filter(lambda it: isinstance(it, str) and not problem_of(it))
            self.publish(ENGINES_SENDER, commands.map(lambda it: Sender(it, self.get_name())))

    def stating(self, facts: Mapping[str, str], items: Observable[T]) -> Observable[T]:
        """Return the items; each health report has these facts while they are observed."""

        def begin(_: Any) -> Observable[T]:
            self.health.facts = facts
            return items.finally_action(end)

        def end() -> None:
            self.health.facts = {}

        return rx.defer(begin)

    def age(self, stamp: datetime) -> float:
        """Return how long ago a DDS source time is [s]; negative if its clock is ahead of the local one.

        It is a time of day, even while ROS time is simulated. This clock may be set, and differs between
        hosts: safety takes only the age at arrival from it, and counts on by the Rx clock.
        """
        return (stamps.now() - stamp).total_seconds()

    def stamp_age(self, nanoseconds: int) -> float:
        """Return how long ago the stamp of a header is [s], by ROS time; see :meth:`age`."""
        return (self.scheduler.time_of_stamps() - nanoseconds) / 1e9

    def _staleness(self, max_age: float, stamp: datetime) -> str:
        """Return why a source time is too old [s], or too much ahead; empty if it is neither."""
        return not_fresh(self.age(stamp), max_age, max_age)

    def reject(self, rejected: Rejected) -> None:
        """Count and report an input that a recipe rejects."""
        self.health.drop(real_name(self, rejected.topic), rejected.reason)

    def remark(self, subject: str, reason: str) -> None:
        self.health.remark(subject, reason)

    def drop(self, name: str, error: Exception) -> None:
        self.health.drop(name, str(error))

    def _look(self) -> None:
        """Remark what is wrong; end the service with its keys, for no other hears it any longer."""
        for problem in self.peers.problems():
            self.remark(*problem)
        if (keys := self.health.keys) and (now := datetime.now(UTC)) >= keys.end:
            raise UserError(keys.problem(now))


def _only_finite(parameters: list[Parameter]) -> SetParametersResult:
    for parameter in parameters:
        if isinstance(parameter.value, float) and not math.isfinite(parameter.value):
            return SetParametersResult(successful=False, reason=f"{parameter.value} is not finite")
    return SetParametersResult(successful=True)
