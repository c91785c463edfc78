"""Nodes: the participants of the ROS graph."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, TypeVar

from rcl_interfaces.msg import Log, ParameterEvent
from rclpy import _best_available, _names, callback_groups
from rclpy._arguments import parse
from rclpy._endpoint import PublisherEndpoint, ServiceEndpoint, SubscriptionEndpoint
from rclpy._node_graph import NodeGraph
from rclpy._node_parameters import NodeParameters
from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.client import Client
from rclpy.clock import Clock, ROSClock
from rclpy.constants import S_TO_NS
from rclpy.duration import Duration
from rclpy.event_handler import (
    EndpointEvents,
    PublisherEventCallbacks,
    SubscriptionEventCallbacks,
)
from rclpy.exceptions import NotInitializedException
from rclpy.guard_condition import GuardCondition
from rclpy.impl import _logging_output
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.logging import get_logger
from rclpy.logging_service import LoggingService
from rclpy.parameter import PARAMETER_SEPARATOR_STRING, Parameter
from rclpy.parameter_service import ParameterService
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    qos_profile_parameter_events,
    qos_profile_services_default,
)
from rclpy.qos_overriding_options import QoSOverridingOptions, _declare_qos_parameters
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.time_source import TimeSource
from rclpy.timer import Rate, Timer
from rclpy.type_description_service import TypeDescriptionService
from rclpy.type_support import check_is_valid_msg_type, check_is_valid_srv_type
from rclpy.utilities import get_default_context
from rclpy.validate_namespace import validate_namespace
from rclpy.validate_node_name import validate_node_name
from rclpy.validate_topic_name import validate_topic_name
from rclpy.waitable import Waitable

__all__ = [
    "HIDDEN_NODE_PREFIX",
    "PARAMETER_SEPARATOR_STRING",
    "S_TO_NS",
    "Node",
    "qos_profile_parameter_events",
    "qos_profile_services_default",
]

# Re-exports: programs written for ROS 2 import these names from here (tests/conformance/test_imports.py).
from typing import Dict, List, Optional, Union  # noqa: F401, UP035

from rcl_interfaces.msg import (  # noqa: F401
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    ParameterType,
    ParameterValue,
    SetParametersResult,
)
from rclpy._type_variables import MsgType, SrvType, SrvTypeRequest, SrvTypeResponse  # noqa: F401
from rclpy.callback_groups import ReentrantCallbackGroup  # noqa: F401
from rclpy.context import Context
from rclpy.exceptions import (  # noqa: F401
    InvalidHandle,
    NodeNameNonExistentError,
    ParameterNotDeclaredException,
)
from rclpy.executors import Executor

HIDDEN_NODE_PREFIX = "_"

# Source: rcl_qos_profile_rosout_default.
_ROSOUT_QOS = QoSProfile(
    depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL, lifespan=Duration(seconds=10)
)

_Entity = TypeVar("_Entity")


class Node(NodeParameters, NodeGraph):
    """A named participant of the ROS graph, with its publishers, subscriptions, services and timers."""

    def __init__(
        self,
        node_name: str,
        *,
        context: Context | None = None,
        cli_args: list[str] | None = None,
        namespace: str | None = None,
        use_global_arguments: bool = True,
        enable_rosout: bool = True,
        start_parameter_services: bool = True,
        parameter_overrides: list[Parameter] | None = None,
        allow_undeclared_parameters: bool = False,
        automatically_declare_parameters_from_overrides: bool = False,
        enable_logger_service: bool = False,
    ) -> None:
        """Create a node.

        :param node_name: its name, unless remapped (``__node``).
        :param context: its context; the default context if ``None``.
        :param cli_args: ROS arguments for this node only, in addition to those of the process.
        :param namespace: its namespace, unless remapped (``__ns``).
        :param use_global_arguments: whether the arguments of the process apply to it.
        :param enable_rosout: whether its log messages are published on ``/rosout``.
        :param start_parameter_services: whether other nodes can get and set its parameters.
        :param parameter_overrides: values that override those of parameter files and arguments.
        :param allow_undeclared_parameters: whether undeclared parameters are allowed.
        :param automatically_declare_parameters_from_overrides: whether overrides declare parameters.
        :param enable_logger_service: whether other nodes can get and set its logger levels.
        :raises NotInitializedException: if the context is not initialized.
        :raises InvalidNodeNameException, InvalidNamespaceException: if a name is invalid.
        """
        self._context = get_default_context() if context is None else context
        if not self._context.ok():
            raise NotInitializedException("cannot create node")
        validate_node_name(node_name)
        namespace = namespace if namespace and namespace[0] == "/" else f"/{namespace or ''}"
        validate_namespace(namespace)
        process_arguments = self._context._rclpy_arguments if use_global_arguments else parse([])
        own_arguments = parse(cli_args or [])
        self._rclpy_arguments = own_arguments.before(process_arguments)
        self._rclpy_name, self._rclpy_namespace = self._rclpy_arguments.node_name(node_name, namespace)
        self._rclpy_fully_qualified_name = f"{self._rclpy_namespace.rstrip('/')}/{self._rclpy_name}"
        self._logger = get_logger(self._rclpy_fully_qualified_name.lstrip("/").replace("/", "."))
        self._clock = ROSClock()
        self._rclpy_executor: weakref.ref[Executor] | None = None
        self._publishers: list[Publisher] = []
        self._subscriptions: list[Subscription] = []
        self._services: list[Service] = []
        self._clients: list[Client] = []
        self._timers: list[Timer] = []
        self._guards: list[GuardCondition] = []
        self._rclpy_actions: list[Any] = []
        self._rclpy_added_waitables: list[Waitable] = []
        self._rclpy_rates: dict[Rate, Timer] = {}
        self._rclpy_events: dict[Publisher | Subscription, EndpointEvents] = {}
        self._rclpy_used_types: set[Any] = set()  # for the service get_type_description
        self._rclpy_entities_version = 0
        self._default_callback_group = MutuallyExclusiveCallbackGroup()

        overrides = self._rclpy_arguments.parameter_overrides(self._rclpy_fully_qualified_name)
        overrides.update({parameter.name: parameter for parameter in parameter_overrides or []})
        self._rclpy_init_parameters(overrides, allow_undeclared=allow_undeclared_parameters)

        self._rclpy_rosout_publisher: Publisher | None = None
        self._rclpy_log_listener = _weak_call(self._rclpy_publish_log)
        self._rclpy_graph = self._context._rclpy_join_domain(self)
        with self._rclpy_graph.one_announcement():
            self._rclpy_graph.add_node(
                self, partial(_forget_dropped, self._context, self._rclpy_log_listener)
            )
            try:
                if enable_rosout and self._context._rclpy_arguments.rosout_logs:
                    self._rclpy_rosout_publisher = self._rclpy_create_own_publisher(
                        Log, "/rosout", _ROSOUT_QOS
                    )
                    _logging_output.add_rosout_publisher(self._logger.name, self._rclpy_log_listener)
                self._parameter_event_publisher = self.create_publisher(
                    ParameterEvent, "/parameter_events", qos_profile_parameter_events
                )
                if automatically_declare_parameters_from_overrides:
                    self._rclpy_declare_overrides()
                self._time_source = TimeSource(node=self)
                self._time_source.attach_clock(self._clock)
                if start_parameter_services:
                    self._parameter_service = ParameterService(self)
                if enable_logger_service:
                    self._logger_service = LoggingService(self)
                self._type_description_service = TypeDescriptionService(self)
            except BaseException:
                Node.destroy_node(self)  # not an override: the subclass is not initialized yet
                raise

    # Properties

    @property
    def default_callback_group(self) -> CallbackGroup:
        """The callback group of entities without another one: their callbacks run one at a time."""
        return self._default_callback_group

    def get_clock(self) -> Clock:
        """Return the node's clock, of type ROS time."""
        return self._clock

    def get_logger(self) -> RcutilsLogger:
        return self._logger

    # Execution

    @property
    def executor(self) -> Executor | None:
        """The last living executor that got the node, perhaps by ``rclpy.spin_once()``."""
        return None if self._rclpy_executor is None else self._rclpy_executor()

    @executor.setter
    def executor(self, new_executor: Executor | None) -> None:
        current = self.executor
        if current is new_executor:
            return
        if current is not None:
            current.remove_node(self)
        self._rclpy_executor = None if new_executor is None else weakref.ref(new_executor)
        if new_executor is not None:
            new_executor.add_node(self)

    def _wake_executor(self) -> None:
        executor = self.executor
        if executor is not None:
            executor._rclpy_wake_if_waiting()

    def _rclpy_entities_have_changed(self) -> None:
        self._rclpy_entities_version += 1
        executor = self.executor
        if executor is not None:
            executor._rclpy_entities_have_changed()

    def _rclpy_waitables(self) -> list[Any]:
        return [
            *list(self._subscriptions),
            *list(self._services),
            *list(self._clients),
            *list(self._rclpy_events.values()),
            *list(self._rclpy_actions),
        ]

    def _rclpy_entities(self) -> list[Any]:
        timers = (timer for action in list(self._rclpy_actions) for timer in action._rclpy_timers)
        entities = [*self._rclpy_waitables(), *list(self._rclpy_added_waitables)]
        return [*entities, *list(self._timers), *timers, *list(self._guards)]

    # Entities

    @property
    def publishers(self) -> Iterator[Publisher]:
        yield from list(self._publishers)

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        yield from list(self._subscriptions)

    @property
    def clients(self) -> Iterator[Client]:
        yield from list(self._clients)

    @property
    def services(self) -> Iterator[Service]:
        yield from list(self._services)

    @property
    def timers(self) -> Iterator[Timer]:
        yield from list(self._timers)

    @property
    def guards(self) -> Iterator[GuardCondition]:
        yield from list(self._guards)

    @property
    def waitables(self) -> Iterator[Waitable]:
        """The node's action clients and servers, added waitables, and QoS event handlers."""
        yield from list(self._rclpy_actions)
        yield from list(self._rclpy_added_waitables)
        for publisher in self.publishers:
            yield from publisher.event_handlers
        for subscription in self.subscriptions:
            yield from subscription.event_handlers

    def add_waitable(self, waitable: Waitable) -> None:
        """Add a waitable: the executor waits for what it adds to the wait set, and runs it."""
        self._rclpy_add(self._rclpy_list_of(waitable), waitable)

    def remove_waitable(self, waitable: Waitable) -> None:
        """Remove a waitable. Raises ValueError if it was not added."""
        self._rclpy_list_of(waitable).remove(waitable)
        self._rclpy_entities_have_changed()

    def _rclpy_list_of(self, waitable: Waitable) -> list[Any]:
        """The list of action clients and servers, which executors know, or of the user's waitables."""
        return self._rclpy_actions if hasattr(waitable, "_rclpy_handles") else self._rclpy_added_waitables

    # Creating

    def create_publisher(
        self,
        msg_type: Any,
        topic: str,
        qos_profile: QoSProfile | int,
        *,
        callback_group: CallbackGroup | None = None,
        event_callbacks: PublisherEventCallbacks | None = None,
        qos_overriding_options: QoSOverridingOptions | None = None,
        publisher_class: type[Publisher] = Publisher,
    ) -> Publisher:
        """Create a publisher.

        :param qos_profile: the offered QoS, or only the depth of the history.
        :param callback_group: the group of its event callbacks.
        :param qos_overriding_options: the policies that parameters may override.
        :raises InvalidTopicNameException: if the topic's name is invalid.
        """
        profile, name = self._rclpy_endpoint_options(
            Publisher, msg_type, topic, qos_profile, qos_overriding_options
        )
        dds_name = _names.topic_to_dds(name, avoid_conventions=profile.avoid_ros_namespace_conventions)
        writer = self._rclpy_graph.create_writer(self, dds_name, msg_type, profile)
        try:
            publisher = publisher_class(
                PublisherEndpoint(self, name, writer),
                msg_type,
                topic,
                profile,
                event_callbacks=event_callbacks or PublisherEventCallbacks(),
                callback_group=callback_group or self._default_callback_group,
            )
        except Exception:
            self._rclpy_graph.destroy(self, writer)
            raise
        if publisher.event_handlers:
            self._rclpy_events[publisher] = EndpointEvents(publisher.event_handlers, writer)
        self._rclpy_add(self._publishers, publisher)
        return publisher

    def _rclpy_create_own_publisher(self, msg_type: Any, topic: str, qos_profile: QoSProfile) -> Publisher:
        """Create an internal publisher: it is not listed, and its events are not reported."""
        silent = PublisherEventCallbacks(use_default_callbacks=False)
        publisher = Node.create_publisher(self, msg_type, topic, qos_profile, event_callbacks=silent)
        self._publishers.remove(publisher)
        return publisher

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callable[..., Any],
        qos_profile: QoSProfile | int,
        *,
        callback_group: CallbackGroup | None = None,
        event_callbacks: SubscriptionEventCallbacks | None = None,
        qos_overriding_options: QoSOverridingOptions | None = None,
        raw: bool = False,
    ) -> Subscription:
        """Create a subscription.

        :param callback: called with each message, and with its info if it takes two arguments.
        :param qos_profile: the requested QoS, or only the depth of the history.
        :param callback_group: the group of its callback and event callbacks.
        :param qos_overriding_options: the policies that parameters may override.
        :param raw: whether the callback gets serialized messages (``bytes``).
        :raises InvalidTopicNameException: if the topic's name is invalid.
        """
        subscription = self._rclpy_make_subscription(
            msg_type,
            topic,
            callback,
            qos_profile,
            callback_group or callback_groups._own_group.get() or self._default_callback_group,
            event_callbacks or SubscriptionEventCallbacks(),
            qos_overriding_options,
            raw=raw,
        )
        subscription.callback_group.add_entity(subscription)
        if subscription.event_handlers:
            self._rclpy_events[subscription] = EndpointEvents(
                subscription.event_handlers, subscription.handle
            )
        self._rclpy_add(self._subscriptions, subscription)
        return subscription

    def _rclpy_make_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callable[..., Any],
        qos_profile: QoSProfile | int,
        group: CallbackGroup,
        event_callbacks: SubscriptionEventCallbacks,
        overriding: QoSOverridingOptions | None = None,
        *,
        raw: bool = False,
    ) -> Subscription:
        """Make a subscription that is not listed: executors do not take its messages."""
        profile, name = self._rclpy_endpoint_options(Subscription, msg_type, topic, qos_profile, overriding)
        dds_name = _names.topic_to_dds(name, avoid_conventions=profile.avoid_ros_namespace_conventions)
        reader = self._rclpy_graph.create_reader(self, dds_name, msg_type, profile)
        endpoint = SubscriptionEndpoint(self, name, reader)
        try:
            return Subscription(endpoint, msg_type, topic, callback, group, profile, raw, event_callbacks)
        except Exception:
            self._rclpy_graph.destroy(self, reader)
            raise

    def _rclpy_endpoint_options(
        self,
        kind: type[Publisher] | type[Subscription],
        msg_type: Any,
        topic: str,
        qos_profile: QoSProfile | int,
        overriding: QoSOverridingOptions | None,
    ) -> tuple[QoSProfile, str]:
        """Return the profile, with overrides, and the fully qualified topic name of a new endpoint."""
        self._rclpy_check_usable()
        check_is_valid_msg_type(msg_type)
        self._rclpy_used_types.add(msg_type)
        if isinstance(qos_profile, QoSProfile):
            profile = qos_profile
        elif isinstance(qos_profile, int):
            if qos_profile < 0:
                raise ValueError("history depth must be greater than or equal to zero")
            profile = QoSProfile(depth=qos_profile)
        else:
            raise TypeError(f"Expected QoSProfile or int, but received {type(qos_profile)!r}")
        validate_topic_name(topic)
        name = self._rclpy_remapped(topic)
        if overriding is not None:
            _declare_qos_parameters(kind, self, name, profile, overriding)
        return profile, name

    def create_service(
        self,
        srv_type: Any,
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        *,
        qos_profile: QoSProfile = qos_profile_services_default,
        callback_group: CallbackGroup | None = None,
    ) -> Service:
        """Create a service.

        :param callback: gets a request and an empty response, and returns the response.
        :raises InvalidServiceNameException: if the service's name is invalid.
        """
        group = callback_group or self._default_callback_group
        endpoint = self._rclpy_service_endpoint(srv_type, srv_name, qos_profile, is_server=True)
        service = Service(endpoint, srv_type, srv_name, callback, group, qos_profile)
        group.add_entity(service)
        self._rclpy_add(self._services, service)
        return service

    def create_client(
        self,
        srv_type: Any,
        srv_name: str,
        *,
        qos_profile: QoSProfile = qos_profile_services_default,
        callback_group: CallbackGroup | None = None,
    ) -> Client:
        """Create a client of a service. Raises InvalidServiceNameException if its name is invalid."""
        group = callback_group or self._default_callback_group
        endpoint = self._rclpy_service_endpoint(srv_type, srv_name, qos_profile, is_server=False)
        client = Client(self._context, endpoint, srv_type, srv_name, qos_profile, group)
        group.add_entity(client)
        self._rclpy_add(self._clients, client)
        return client

    def _rclpy_service_endpoint(
        self, srv_type: Any, srv_name: str, profile: QoSProfile, *, is_server: bool
    ) -> ServiceEndpoint:
        self._rclpy_check_usable()
        check_is_valid_srv_type(srv_type)
        self._rclpy_used_types.add(srv_type)
        validate_topic_name(srv_name, is_service=True)
        name = self._rclpy_remapped(srv_name, is_service=True)
        profile = _best_available.for_service(profile)
        graph = self._rclpy_graph
        identifier = graph.next_service_id()
        text = ".".join(f"{octet:x}" for octet in identifier)
        identity = f"{'serviceid' if is_server else 'clientid'}= {text};"
        requests = (_names.request_to_dds(name), srv_type.Request, profile, identity)
        replies = (_names.reply_to_dds(name), srv_type.Response, profile, identity)
        with graph.one_announcement():
            writer = graph.create_writer(self, *(replies if is_server else requests))
            try:
                reader = graph.create_reader(self, *(requests if is_server else replies))
            except Exception:
                graph.destroy(self, writer)
                raise
        return ServiceEndpoint(self, name, writer, reader, identifier)

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[[], Any],
        callback_group: CallbackGroup | None = None,
        clock: Clock | None = None,
        autostart: bool = True,
    ) -> Timer:
        """Create a timer.

        :param timer_period_sec: period [s].
        :param clock: its clock; the node's if ``None``.
        :param autostart: whether it starts now, or with :meth:`rclpy.timer.Timer.reset`.
        """
        self._rclpy_check_usable()
        group = callback_group or self._default_callback_group
        timer = Timer(
            callback,
            group,
            int(float(timer_period_sec) * S_TO_NS),
            clock or self._clock,
            context=self._context,
            autostart=autostart,
        )
        timer._rclpy_on_change = self._wake_executor
        group.add_entity(timer)
        self._rclpy_add(self._timers, timer)
        return timer

    def create_guard_condition(
        self, callback: Callable[[], Any], callback_group: CallbackGroup | None = None
    ) -> GuardCondition:
        """Create a guard condition, whose callback runs after each trigger."""
        self._rclpy_check_usable()
        group = callback_group or self._default_callback_group
        guard = GuardCondition(callback, group, context=self._context)
        guard._rclpy_on_change = self._wake_executor
        group.add_entity(guard)
        self._rclpy_add(self._guards, guard)
        return guard

    def create_rate(self, frequency: float, clock: Clock | None = None) -> Rate:
        """Create a rate [Hz], for threads that do not spin the node. Raises ValueError if not positive."""
        if frequency <= 0:
            raise ValueError("frequency must be > 0")
        # A separate group: callbacks of the node must not delay the rate.
        group = MutuallyExclusiveCallbackGroup()
        timer = self.create_timer(1.0 / frequency, lambda: None, group, clock)
        rate = Rate(timer, context=self._context)
        self._rclpy_rates[rate] = timer
        return rate

    def _rclpy_add(self, entities: list[_Entity], entity: _Entity) -> None:
        entities.append(entity)
        self._rclpy_entities_have_changed()

    # Destroying

    def _rclpy_destroy(self, entities: list[Any], entity: Any) -> bool:
        try:
            entities.remove(entity)
        except ValueError:
            return False
        self._rclpy_events.pop(entity, None)
        entity.destroy()
        self._rclpy_entities_have_changed()
        return True

    def destroy_publisher(self, publisher: Publisher) -> bool:
        """Destroy a publisher; return ``False`` if the node does not have it."""
        return self._rclpy_destroy(self._publishers, publisher)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        return self._rclpy_destroy(self._subscriptions, subscription)

    def destroy_client(self, client: Client) -> bool:
        return self._rclpy_destroy(self._clients, client)

    def destroy_service(self, service: Service) -> bool:
        return self._rclpy_destroy(self._services, service)

    def destroy_timer(self, timer: Timer) -> bool:
        return self._rclpy_destroy(self._timers, timer)

    def destroy_guard_condition(self, guard: GuardCondition) -> bool:
        return self._rclpy_destroy(self._guards, guard)

    def destroy_rate(self, rate: Rate) -> bool:
        """Destroy a rate and wake its sleepers; return ``False`` if the node does not have it."""
        timer = self._rclpy_rates.pop(rate, None)
        if timer is None:
            return False
        rate.destroy()
        return self.destroy_timer(timer)

    def destroy_node(self) -> None:
        """Destroy the node and all its entities. None of them may be used afterwards."""
        if self._rclpy_destroyed:
            return
        executor = self.executor
        if executor is not None:
            executor.remove_node(self)
        for rate in list(self._rclpy_rates):
            self.destroy_rate(rate)
        with self._rclpy_graph.one_announcement():
            if self._rclpy_rosout_publisher is not None:
                _logging_output.remove_rosout_publisher(self._rclpy_log_listener)
                self._rclpy_rosout_publisher.destroy()
            self._rclpy_destroyed = True
            for entities in (
                self._publishers,
                self._subscriptions,
                self._services,
                self._clients,
                self._timers,
                self._guards,
            ):
                for entity in list(entities):
                    self._rclpy_destroy(entities, entity)
            for action in list(self._rclpy_actions):
                action._rclpy_close()
            self._rclpy_graph.remove_node(self)
        self._context._rclpy_forget(self)

    # Internal entities, for which rclpy of ROS 2 calls no method that a user's class may override

    _rclpy_create_service = create_service
    _rclpy_destroy_service = destroy_service
    _rclpy_create_timer = create_timer
    _rclpy_destroy_timer = destroy_timer

    def _rclpy_publish_parameter_event(self, event: ParameterEvent) -> None:
        self._parameter_event_publisher.publish(event)

    def _rclpy_publish_log(self, record: _logging_output.LogRecord) -> None:
        publisher = self._rclpy_rosout_publisher
        if publisher is None or self._rclpy_destroyed or not self._context.ok():
            return
        message = Log()
        message.stamp.sec, message.stamp.nanosec = divmod(record.stamp, S_TO_NS)
        message.level = record.level
        message.name, message.msg = record.name, record.message
        message.file, message.function, message.line = record.file, record.function, record.line
        publisher.publish(message)


def _weak_call(method: Callable[[Any], None]) -> Callable[[Any], None]:
    """Return a function that calls a bound method while its object exists, without keeping it alive."""
    reference = weakref.WeakMethod(method)

    def call(argument: Any) -> None:
        if (method := reference()) is not None:
            method(argument)

    return call


def _forget_dropped(context: Context, log_listener: Callable[[Any], None]) -> None:
    """Clean up after a node that was garbage-collected without ``destroy_node``."""
    _logging_output.remove_rosout_publisher(log_listener)
    context._rclpy_leave_if_unused()
