"""The life of a service: one process that holds one recipe.

A service's module ends with ::

    def wire(node: ServiceNode) -> None:
        node.publish(EFFECTOR_SPEED, effector_speed(node.observe(EFFECTOR_POSITION)))

    def main() -> None:
        service.run("velocity", wire)

and :func:`run` does the rest: it starts, refuses to be a second instance, spins, reports its health,
and ends with one of these exit codes: 0 on SIGTERM or Ctrl-C, 1 after an error of the recipe or as a second
instance, 2 after a mistake in its parameters, scenario or command line. Errors take one line, or one log
message.
"""

from __future__ import annotations

import hashlib
import math
import os
import socket
import struct
import sys
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable
from datetime import datetime
from typing import Any, NoReturn, TypeVar

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from reactivex import Observable, abc
from reactivex.disposable import CompositeDisposable

from interfaces.service import stopping
from interfaces.service.errors import UserError
from interfaces.service.parameters import Declaration, declarations
from interfaces.topics import DIAGNOSTICS, Topic, is_latched
from reactive_node import ReactiveNode
from reactive_node.stamps import Timestamp

T = TypeVar("T")
_HEALTH_PERIOD = 1.0  # [s]
_MISTAKES = (NameValidationException, ParameterException, UserError)  # of who started it
_REASONS, _OTHER_REASONS = 4, "other reasons"  # that a report tells of a topic
_RECENT = 16  # messages of which a second reader may bring a copy


class ServiceNode(ReactiveNode):
    """A node that speaks the contract, keeps bad input out, and reports its health."""

    def __init__(self, node_name: str, **options: Any) -> None:
        """Create the node of a service; the options are those of :class:`rclpy.node.Node`."""
        super().__init__(node_name, **options)
        self._started = time.monotonic()
        self._observed: list[Topic] = []
        self._published_count = 0
        self._last_output: float | None = None
        self._dropped_count = 0
        self._remarks: dict[str, Counter[str]] = {}  # since the last report: about what, why, how often
        self._logged: set[str] = set()  # those of the last report
        self.add_on_set_parameters_callback(_only_finite)
        self._health = self.create_publisher(
            DIAGNOSTICS.type,
            DIAGNOSTICS.name,
            DIAGNOSTICS.qos,
            # Who has just come need not wait: the launcher for a start, the sentinel after its own.
            event_callbacks=PublisherEventCallbacks(matched=self._greet),
        )
        # By the steady clock even while ROS time is simulated: a simulation that pauses is no hung service.
        self.create_timer(_HEALTH_PERIOD, self.report_health, clock=Clock(clock_type=ClockType.STEADY_TIME))

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

    def observe(self, topic: Topic, *, timestamped: bool = False) -> Observable[Any]:
        """
        Return the good messages of a topic; the others are dropped and reported.

        :param timestamped: see :meth:`ReactiveNode.create_observable`.
        """
        self._observed.append(topic)
        if is_latched(topic.qos):
            items = self._from_every_publisher(topic)
        else:
            items = self.create_observable(topic.type, topic.name, topic.qos, timestamped=True)
        sound = items.filter(lambda item: self._is_sound(topic, item.value))
        return sound if timestamped else sound.map(lambda item: item.value)

    def _from_every_publisher(self, topic: Topic) -> Observable[Timestamp[Any]]:
        """
        Return the messages of a latched topic, also those of publishers that are not latched.

        A transient-local reader gets nothing from a volatile publisher, such as ``ros2 topic pub``; when
        there is one, a volatile reader listens as well.
        """

        def subscribe(
            observer: abc.ObserverBase[Timestamp[Any]], scheduler: abc.SchedulerBase | None = None
        ) -> abc.DisposableBase:
            readers = CompositeDisposable()
            recent: deque[datetime] = deque(maxlen=_RECENT)
            listens = False  # to volatile publishers, too

            def forward(item: Timestamp[Any]) -> None:
                if item.timestamp not in recent:
                    recent.append(item.timestamp)
                    observer.on_next(item)

            def add(qos: QoSProfile, **options: Any) -> None:
                messages = self.create_observable(topic.type, topic.name, qos, timestamped=True, **options)
                readers.add(messages.subscribe(forward, observer.on_error, observer.on_completed))

            def incompatible(_: Any) -> None:
                nonlocal listens
                if not listens:
                    listens = True
                    add(QoSProfile(depth=topic.qos.depth, durability=DurabilityPolicy.VOLATILE))

            add(topic.qos, event_callbacks=SubscriptionEventCallbacks(incompatible_qos=incompatible))
            return readers

        return Observable(subscribe)

    def publish(self, topic: Topic, messages: Observable[Any]) -> None:
        """Publish on a topic; a message that the contract does not know is dropped and reported instead."""

        def count(_: Any) -> None:
            self._published_count += 1
            self._last_output = time.monotonic()

        sound = messages.filter(lambda message: self._is_sound(topic, message)).do_action(count)
        self.publish_observable(sound, topic.type, topic.name, topic.qos)

    def _is_sound(self, topic: Topic, message: Any) -> bool:
        fault = topic.problem(message)
        if fault:
            self.drop(topic.name, fault)
        return not fault

    # Health

    def drop(self, what: str, why: str) -> None:
        """Count bad input; the next health message reports it."""
        self._dropped_count += 1
        self.remark(what, why)

    def remark(self, what: str, why: str) -> None:
        """Let the next health message be a warning that says this."""
        reasons = self._remarks.setdefault(what, Counter())
        reasons[why if why in reasons or len(reasons) < _REASONS else _OTHER_REASONS] += 1

    def _greet(self, readers: Any) -> None:
        if readers.current_count_change > 0:
            self.report_health()

    def report_health(self) -> None:
        """Publish the health, with all remarks since the last time; this happens at 1 Hz anyway."""
        for topic in self._observed:
            for publisher in self.get_publishers_info_by_topic(self.resolve_topic_name(topic.name)):
                if publisher.topic_type != topic.type_name:
                    self.remark(topic.name, f"{publisher.node_name} publishes {publisher.topic_type}")
        remarks, self._remarks = self._remarks, {}
        counts = {f"{what}: {why}": n for what, reasons in remarks.items() for why, n in reasons.items()}
        if counts.keys() - self._logged:
            self.get_logger().warning("; ".join(sorted(counts)))
        self._logged = set(counts)
        told = [remark + (f" ({n} times)" if n > 1 else "") for remark, n in counts.items()]
        now = time.monotonic()
        silence = "" if self._last_output is None else f"{now - self._last_output:.3f}"
        values = {
            "pid": os.getpid(),
            "uptime": f"{now - self._started:.3f}",
            "published": self._published_count,
            "dropped": self._dropped_count,
            "seconds_since_output": silence,
        }
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if told else DiagnosticStatus.OK,
            name=self.get_fully_qualified_name(),
            message="; ".join(told) or "running",
            hardware_id=socket.gethostname(),
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        health = DiagnosticArray(status=[status])
        health.header.stamp = self.get_clock().now().to_msg()
        self._health.publish(health)


def _only_finite(parameters: list[Parameter]) -> SetParametersResult:
    for parameter in parameters:
        if isinstance(parameter.value, float) and not math.isfinite(parameter.value):
            return SetParametersResult(successful=False, reason=f"{parameter.value} is not finite")
    return SetParametersResult(successful=True)


class _AlreadyRunning(Exception):
    """There is a live instance of this service on this host and domain."""


def _claim(node: ServiceNode) -> socket.socket:
    """
    Claim the name of a node on this host and domain, for as long as the returned socket lives.

    An abstract unix socket holds the claim: the kernel ends it with the process, however that dies.

    :raises _AlreadyRunning: if a live process holds it.
    """
    name = node.get_fully_qualified_name()
    domain = node.context.get_domain_id()
    digest = hashlib.sha256(name.encode()).hexdigest()[:32]  # such an address has 107 bytes at most
    address = f"\0reactive-arm/{domain}/{digest}"
    claim = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        claim.bind(address)
    except OSError:
        with claim:
            raise _AlreadyRunning(f"{name} runs already in domain {domain}: {_holder(address)}") from None
    claim.listen()
    return claim


def _holder(address: str) -> str:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as question:
        question.setblocking(False)
        try:
            question.connect(address)
            credentials = question.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
            return f"process {struct.unpack('3i', credentials)[0]}"
        except OSError:  # it ended just now, or so many have asked that the kernel does not let us
            return "process unknown"


def run(name: str, wire: Callable[[ServiceNode], None]) -> NoReturn:
    """
    Be a service until the process ends.

    :param name: name of the node, unless remapped.
    :param wire: declares the parameters, builds the recipe and connects it with topics.
    """
    stopping.prepare()
    code = _live(name, wire)
    stopping.ending()
    sys.exit(code)


def refuse(name: str, reason: str) -> NoReturn:
    """End after a mistake on the command line, saying it in one line."""
    sys.exit(_refuse(name, reason, 2))


def _live(name: str, wire: Callable[[ServiceNode], None]) -> int:
    """Return the exit code."""
    try:
        rclpy.init()
        node = ServiceNode(name)
    except (*_MISTAKES, RuntimeError) as error:  # the latter of the environment: domain, discovery, DDS
        rclpy.try_shutdown()
        return _refuse(name, error, 2)
    try:
        return _spin(node, wire)
    except _MISTAKES as error:
        return _refuse(name, error, 2)
    except _AlreadyRunning as error:
        return _refuse(name, error, 1)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _spin(node: ServiceNode, wire: Callable[[ServiceNode], None]) -> int:
    with _claim(node), SingleThreadedExecutor() as executor:
        try:
            wire(node)
            executor.add_node(node)
            stopping.spinning()
            executor.spin()
        except ExternalShutdownException:
            pass
        except _MISTAKES:
            raise
        except Exception:
            if not node.context.ok():  # a signal came while it was about to publish, which is no error
                return 0
            node.get_logger().fatal(traceback.format_exc())
            return 1
    return 0


def _refuse(name: str, reason: object, code: int) -> int:
    print(f"{name}: {' '.join(str(reason).split())}", file=sys.stderr, flush=True)
    return code
