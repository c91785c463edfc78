"""Topics as observables, observables as topics (thesis chapter 4)."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import cached_property
from typing import Any

import reactivex as rx
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from reactivex import Observable, abc
from reactivex.disposable import CompositeDisposable, Disposable, SingleAssignmentDisposable
from reactivex.subject import BehaviorSubject

from reactive_node import calls
from reactive_node.end import End
from reactive_node.groups import forget_the_gone
from reactive_node.message_reader import MessageReader
from reactive_node.sampled_reader import BUFFER, SampledReader, keep_last
from reactive_node.scheduler import NodeScheduler
from reactive_node.services import Requests
from reactive_node.shared_reader import SharedReader
from reactive_node.strangers import TolerantNode

_DELIVERY = 0.1  # [s], for all readers together: one of them may be dead


class ReactiveNode(TolerantNode):
    """A node whose topics, parameters, events and calls are observables; it publishes others."""

    def __init__(self, node_name: str, **options: Any) -> None:
        """Create a node; the options are those of :class:`rclpy.node.Node`."""
        super().__init__(node_name, **options)
        forget_the_gone(self.default_callback_group)
        self._end = End()
        self._sinks = CompositeDisposable()
        self.scheduler = NodeScheduler(self)
        """Schedules on the executor and clock of this node; for ``observable.subscribe(…, scheduler=…)``."""
        self._servers = calls.Servers(self, self.scheduler)

    @cached_property
    def steady_scheduler(self) -> NodeScheduler:
        """Schedules on the executor of this node by the steady clock, even while ROS time is simulated."""
        return NodeScheduler(self, steady=True)

    def create_observable(
        self,
        msg_type: Any,
        topic: str,
        qos_profile: QoSProfile | int = 10,
        *,
        timestamped: bool = False,
        item: Callable[[Any], Any] | None = None,
        every_publisher: bool = False,
        **options: Any,
    ) -> Observable[Any]:
        """Return the messages of a topic as an observable, cold and shared (thesis 4.3).

        There is no DDS reader before the first observer, one for all observers, and none after the last one.
        The observable completes when the node ends. Subscribing and disposing are safe on any thread and
        inside a callback.

        While a transient-local topic has a publisher, a late observer first gets what the shared reader has
        kept. A reader of its own might get fewer: none whose lifespan has passed, none of a publisher that
        has gone, no more than each publisher keeps. With BEST_AVAILABLE durability it gets none.

        :param timestamped: whether items are :class:`Timestamp` s of a message and its DDS source time, a
            time of day.
        :param item: turns each message (or Timestamp) into the item, once for all observers and at less cost
            than the operator ``map``; ``None`` drops it.
        :param every_publisher: whether a transient-local topic also delivers the messages of volatile
            publishers, such as ``ros2 topic pub``, by a second reader; without effect on other topics.
        :param options: further arguments of :meth:`rclpy.node.Node.create_subscription`; with
            ``every_publisher`` without ``event_callbacks`` and with a mutually exclusive callback group.
        """

        def create_reader(callback: Callable[..., None], qos: QoSProfile | int, **given: Any) -> Subscription:
            return self.create_subscription(msg_type, topic, callback, qos, **given, **options)

        reader = MessageReader(
            self,
            create_reader,
            qos_profile,
            scheduler=self.scheduler,
            end=self._end,
            timestamped=timestamped,
            item=item,
            every_publisher=every_publisher,
        )
        return Observable(reader.subscribe)

    def create_sampled_observable(
        self,
        msg_type: Any,
        topic: str,
        ticks: float | Observable[Any],
        qos_profile: QoSProfile | int = 10,
        **options: Any,
    ) -> Observable[Any]:
        """Return the newest message of a topic at each tick, if it has come since the tick before.

        For topics where only the latest message counts (``sample`` of thesis 4.2): what comes between two
        ticks costs no Python. Cold and shared like :meth:`create_observable`; but late observers get no
        retained messages, and QoS events are not warned of. It ends as the ticks do.

        :param ticks: a period [s] on :attr:`scheduler`, with a tick at once, or an observable of ticks.
        :param qos_profile: its history is replaced.
        :param options: ``timestamped`` and ``item`` of :meth:`create_observable`, and further arguments of
            :meth:`rclpy.node.Node.create_subscription`, without ``callback_group`` and ``event_callbacks``.
        :raises ValueError: for a period that is no positive number.
        """
        return self._read_at(ticks, msg_type, topic, keep_last(qos_profile, 1), **options)

    def create_buffered_observable(
        self,
        msg_type: Any,
        topic: str,
        ticks: float | Observable[Any],
        qos_profile: QoSProfile | int = 10,
        *,
        on_full: Callable[[], Any] = lambda: None,
        **options: Any,
    ) -> Observable[Any]:
        """Return at each tick all messages that have come since the tick before; the reader keeps 1000.

        All else, errors included, is as of :meth:`create_sampled_observable`.

        :param on_full: is called at each tick that has read 1000 messages: more may have come, and are lost.
        """
        qos = keep_last(qos_profile, BUFFER)
        return self._read_at(ticks, msg_type, topic, qos, on_full=on_full, **options)

    def _read_at(
        self,
        ticks: float | Observable[Any],
        msg_type: Any,
        topic: str,
        qos: QoSProfile,
        *,
        timestamped: bool = False,
        item: Callable[[Any], Any] | None = None,
        on_full: Callable[[], Any] = lambda: None,
        **options: Any,
    ) -> Observable[Any]:
        if not isinstance(ticks, Observable):
            if not 0 < ticks < math.inf:
                raise ValueError(f"{topic}: a period of {ticks} s is no positive number")
            ticks = rx.timer(0.0, ticks, self.scheduler)

        def create_reader(**given: Any) -> Subscription:
            return self.create_subscription(msg_type, topic, lambda _: None, qos, **given, **options)

        reader = SampledReader(
            self,
            create_reader,
            ticks,
            scheduler=self.scheduler,
            end=self._end,
            timestamped=timestamped,
            item=item,
            most=qos.depth,
            on_full=on_full,
        )
        return Observable(reader.subscribe)

    def create_parameter_observable(self, name: str) -> Observable[Any]:
        """Return the values of a declared parameter: the present one at once, then each new one.

        A value that is set during the subscription may come twice. An undeclared parameter is an error of the
        observable. It completes when the node ends.
        """

        def subscribe(
            observer: abc.ObserverBase[Any], scheduler: abc.SchedulerBase | None = None
        ) -> abc.DisposableBase:
            lock = threading.RLock()  # the present value comes first, even if another thread sets a new one

            def changed(parameters: list[Parameter]) -> None:
                with lock:
                    if any(parameter.name == name for parameter in parameters):
                        # Not the value in `parameters`: an earlier observer may have set another one since.
                        observer.on_next(self.get_parameter(name).value)

            def remove(*_: Any) -> None:
                self.remove_post_set_parameters_callback(changed)

            def remove_later() -> None:  # rclpy skips a callback if one is removed while it calls them
                self.scheduler.schedule(remove)

            end = Disposable(remove_later)
            with lock:
                self.add_post_set_parameters_callback(changed)
                try:
                    observer.on_next(self.get_parameter(name).value)
                except Exception:
                    end.dispose()
                    raise
            return end

        return self._end.limit(Observable(subscribe))

    def create_event_observable(
        self, msg_type: Any, topic: str, qos_profile: QoSProfile | int, event: str
    ) -> Observable[Any]:
        """Return the QoS events of a subscription as an observable, cold and shared.

        :param event: ``deadline``, ``liveliness``, ``message_lost``, ``incompatible_qos``,
            ``incompatible_type`` or ``matched``: see :class:`rclpy.event_handler.SubscriptionEventCallbacks`.
        """

        def create_reader(callback: Callable[..., None]) -> Subscription:
            callbacks: dict[str, Any] = {event: callback}
            events = SubscriptionEventCallbacks(**callbacks)
            return self.create_subscription(
                msg_type, topic, lambda _: None, qos_profile, event_callbacks=events, raw=True
            )

        reader = SharedReader(self, create_reader, scheduler=self.scheduler, end=self._end)
        return Observable(reader.subscribe)

    def create_call(
        self, srv_type: Any, srv_name: str, *, timeout: float | None = None, **options: Any
    ) -> Callable[[Any], Observable[Any]]:
        """Return a function from a request to an observable of the response, for ``requests.flat_map(call)``.

        A call begins with its subscription, waits for a server if there is none, and never blocks.
        Disposing abandons it. It completes when the node ends.

        :param timeout: if no response arrives within this time [s], the observable ends in a TimeoutError.
        :param options: further arguments of :meth:`rclpy.node.Node.create_client`.
        """
        client = self.create_client(srv_type, srv_name, **options)
        ready = self._servers.ready(client.service_is_ready)
        late = rx.throw(TimeoutError(f"no response of {srv_name} within {timeout} s"))

        def call(request: Any) -> Observable[Any]:
            response = calls.response(client, request, self.scheduler)
            result = self._end.limit(ready.flat_map(lambda _: response))
            return result if timeout is None else result.timeout(timeout, late, self.scheduler)

        return call

    def create_action_call(
        self, action_type: Any, action_name: str, **options: Any
    ) -> Callable[[Any], Observable[Any]]:
        """Return a function from a goal to an observable of its execution, for ``goals.flat_map(act)``.

        Each subscription sends the goal when there is a server, and never blocks. Items are the feedback
        messages, then the result message: ``act(goal).last()`` is the result only. A goal that does not
        succeed is an error of the observable, one of :mod:`reactive_node.actions`. Disposing, and the end of
        the node, cancels the goal, so ``goals.map(act).switch_latest()`` replaces it. A server that vanishes
        is not noticed: limit its silence by ``act(goal).timeout(seconds)``.

        :param options: further arguments of :class:`rclpy.action.ActionClient`.
        """
        from rclpy.action import ActionClient  # here: few nodes have actions

        from reactive_node import actions

        client = ActionClient(self, action_type, action_name, **options)
        self._sinks.add(Disposable(client.destroy))
        ready = self._servers.ready(client.server_is_ready)

        def act(goal: Any) -> Observable[Any]:
            execution = actions.execution(client, action_name, goal, self.scheduler)
            return self._end.limit(ready.flat_map(lambda _: execution))

        return act

    def publish_observable(
        self,
        observable: Observable[Any],
        msg_type: Any,
        topic: str,
        qos_profile: QoSProfile | int = 10,
        *,
        message: Callable[[Any], Any] | None = None,
        on_demand: bool = False,
        **options: Any,
    ) -> abc.DisposableBase:
        """Publish every item of an observable until the returned disposable is disposed or the node ends.

        The publisher exists from now on, because peers need time to discover it. An error of the observable,
        or a message of another type, is raised once out of the spinning of this node.

        :param message: turns each item into a message; ``None`` publishes nothing.
        :param on_demand: whether the observable is observed only while the topic has subscribers, with a
            new subscription each time. Without them it costs nothing, down to its own topics.
        :param options: further arguments of :meth:`rclpy.node.Node.create_publisher`; with ``on_demand``
            without ``event_callbacks``. A subject makes an observable of the publisher's QoS events:
            ``event_callbacks=PublisherEventCallbacks(deadline=subject.on_next)``.
        """
        events: dict[str, Any] = {}
        if on_demand:
            demanded: BehaviorSubject[bool] = BehaviorSubject(False)
            events["event_callbacks"] = PublisherEventCallbacks(
                matched=lambda subscribers: demanded.on_next(subscribers.current_count > 0)
            )
            offered = observable
            observable = demanded.distinct_until_changed().switch_map(
                lambda is_demanded: offered if is_demanded else rx.never()
            )
        publisher = self.create_publisher(msg_type, topic, qos_profile, **events, **options)
        subscription = SingleAssignmentDisposable()

        def publish(item: Any) -> None:
            try:
                if message is not None:
                    item = message(item)
                    if item is None:
                        return
                publisher.publish(item)
            except Exception as error:
                if not subscription.is_disposed:  # by an earlier error, while the observable emits at once
                    subscription.dispose()
                    self.fail(error)

        subscription.disposable = observable.subscribe(publish, self.fail, scheduler=self.scheduler)

        def end() -> None:
            subscription.dispose()
            self.destroy_publisher(publisher)
            self._sinks.remove(sink)

        sink = Disposable(end)
        self._sinks.add(sink)
        return sink

    def serve_recipe(
        self,
        recipe: Callable[[Observable[Any]], Observable[tuple[Any, Any]]],
        srv_type: Any,
        srv_name: str,
        **options: Any,
    ) -> abc.DisposableBase:
        """Answer the requests of a service until the returned disposable is disposed or the node ends.

        The recipe maps the requests to pairs of a request and its response, in any order::

            node.serve_recipe(lambda requests: requests.map(lambda r: (r, answer(r))), SetBool, "switch")

        It must answer each request once, with the request itself, not a copy; a client without an answer
        waits. An error of the recipe, its completion, and a wrong answer are raised out of the spinning of
        this node. Then the service ends as well, so clients see that there is no server.

        :param options: further arguments of :meth:`rclpy.node.Node.create_service`, without
            ``callback_group``: requests arrive by the node's scheduler, even while others wait.
        """
        requests = Requests(self, srv_type, srv_name, self.scheduler)
        sink = CompositeDisposable()

        def fail(error: Exception) -> None:
            sink.dispose()
            self.fail(error)

        def completed() -> None:
            fail(RuntimeError(f"the recipe of {srv_name} completed: nothing answers its requests any more"))

        answers = recipe(requests.observable).do_action(requests.answer)
        sink.add(answers.subscribe(on_error=fail, on_completed=completed, scheduler=self.scheduler))
        service = self.create_service(
            srv_type, srv_name, requests.serve, callback_group=ReentrantCallbackGroup(), **options
        )

        def end() -> None:
            requests.close()
            self.destroy_service(service)
            self._sinks.remove(sink)

        sink.add(Disposable(end))
        self._sinks.add(sink)
        return sink

    def fail(self, error: Exception) -> None:
        """Raise an error out of the spinning of this node, where it cannot be lost."""

        def throw(*_: Any) -> None:
            raise error

        self.scheduler.schedule(throw)

    def destroy_node(self) -> None:
        """End the node; its observables complete first. One error that this raises is raised afterwards."""
        with ExitStack() as stack:
            stack.callback(super().destroy_node)
            if not self._end.is_stopped:
                stack.callback(self.scheduler.dispose)
                if "steady_scheduler" in vars(self):
                    stack.callback(self.steady_scheduler.dispose)
                stack.callback(self._sinks.dispose)
                for sink in reversed(self._sinks.to_list()):  # each, even if another one raises
                    stack.callback(sink.dispose)
                stack.callback(self._deliver)
                self._end.come()

    def _deliver(self) -> None:
        """Wait until the last messages are read: Fast DDS drops those of a writer that has ended."""
        end = time.monotonic() + _DELIVERY
        for publisher in self.publishers:
            try:
                publisher.wait_for_all_acked(Duration(seconds=max(0.0, end - time.monotonic())))
            except RuntimeError:  # RCLError; a signal ends the context at any moment
                if self.context.ok():
                    raise
