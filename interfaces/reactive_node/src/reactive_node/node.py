"""Topics as observables, observables as topics (thesis chapter 4).

A :class:`ReactiveNode` is a node like any other and creates observables, as in Listings 4.3 to 4.5::

    node = ReactiveNode("node_name")
    observable = node.create_observable(String, "topic")
    observable.subscribe(print, scheduler=node.scheduler)
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import reactivex as rx
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from reactivex import Observable, abc
from reactivex.disposable import CompositeDisposable, Disposable
from reactivex.subject import AsyncSubject

from reactive_node import calls
from reactive_node.scheduler import NodeScheduler
from reactive_node.shared_reader import SharedReader, retention


class ReactiveNode(Node):
    """A node with observables of topics, parameters, QoS events and calls; it publishes observables."""

    def __init__(self, node_name: str, **options: Any) -> None:
        """Create a node; the options are those of :class:`rclpy.node.Node`."""
        super().__init__(node_name, **options)
        self._end: AsyncSubject[None] = AsyncSubject()
        self._sinks = CompositeDisposable()
        self.scheduler = NodeScheduler(self)
        """Schedules on the executor and clock of this node; for ``observable.subscribe(…, scheduler=…)``."""

    def create_observable(
        self,
        msg_type: Any,
        topic: str,
        qos_profile: QoSProfile | int = 10,
        *,
        timestamped: bool = False,
        **options: Any,
    ) -> Observable[Any]:
        """
        Return the messages of a topic as an observable, cold and shared (thesis 4.3).

        No DDS reader exists before the first observer subscribes. All observers share one reader. The
        disposal of the last observer destroys it; a new subscription creates a new one. A late observer of
        a transient-local topic first gets the retained samples, as with a reader of its own (not with
        BEST_AVAILABLE durability: a reader does not report which durability that has become).
        The observable completes when the node ends. Subscribing and disposing are safe on any thread and
        inside a callback.

        :param timestamped: whether items are :class:`Timestamp` s of a message and its DDS source time,
            instead of messages.
        :param options: further arguments of :meth:`rclpy.node.Node.create_subscription`.
        """

        def create_reader(callback: Callable[..., None]) -> Subscription:
            return self.create_subscription(msg_type, topic, callback, qos_profile, **options)

        reader = SharedReader(
            self,
            create_reader,
            scheduler=self.scheduler,
            end=self._end,
            retained=retention(qos_profile),
            timestamped=timestamped,
        )
        return Observable(reader.subscribe)

    def create_parameter_observable(self, name: str) -> Observable[Any]:
        """
        Return the values of a declared parameter: the present one at once, then each new one.

        A value that another thread or another observer sets during the subscription may come twice.
        A parameter that is not declared is an error of the observable. The observable completes when the
        node ends.
        """

        def subscribe(
            observer: abc.ObserverBase[Any], scheduler: abc.SchedulerBase | None = None
        ) -> abc.DisposableBase:
            lock = threading.RLock()  # the present value comes first, also if another thread sets a new one

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

        return Observable(subscribe).take_until(self._end)

    def create_event_observable(
        self, msg_type: Any, topic: str, qos_profile: QoSProfile | int, event: str
    ) -> Observable[Any]:
        """
        Return the QoS events of a subscription as an observable, cold and shared.

        :param event: ``deadline``, ``liveliness``, ``message_lost``, ``incompatible_qos``,
            ``incompatible_type`` or ``matched``: see :class:`rclpy.event_handler.SubscriptionEventCallbacks`.
        """

        def create_reader(callback: Callable[..., None]) -> Subscription:
            callbacks: dict[str, Any] = {event: callback}
            events = SubscriptionEventCallbacks(**callbacks)
            return self.create_subscription(
                msg_type, topic, lambda _: None, qos_profile, event_callbacks=events
            )

        reader = SharedReader(self, create_reader, scheduler=self.scheduler, end=self._end)
        return Observable(reader.subscribe)

    def create_call(
        self, srv_type: Any, srv_name: str, *, timeout: float | None = None, **options: Any
    ) -> Callable[[Any], Observable[Any]]:
        """
        Return a function from a request to an observable of the response, for ``requests.flat_map(call)``.

        A call begins with its subscription, waits for a server if there is none, and never blocks.
        Disposing abandons it. It completes when the node ends.

        :param timeout: if no response arrives within so many seconds, the observable ends in a TimeoutError.
        :param options: further arguments of :meth:`rclpy.node.Node.create_client`.
        """
        client = self.create_client(srv_type, srv_name, **options)
        ready = calls.server_ready(self, client, self.scheduler)
        late = rx.throw(TimeoutError(f"no response of {srv_name} within {timeout} s"))

        def call(request: Any) -> Observable[Any]:
            response = calls.response(client, request, self.scheduler)
            result = ready.take(1).flat_map(lambda _: response).take_until(self._end)
            return result if timeout is None else result.timeout(timeout, late, self.scheduler)

        return call

    def publish_observable(
        self,
        observable: Observable[Any],
        msg_type: Any,
        topic: str,
        qos_profile: QoSProfile | int = 10,
        **options: Any,
    ) -> abc.DisposableBase:
        """
        Publish every message of an observable until the returned disposable is disposed or the node ends.

        The publisher exists from now on: peers need time to discover it, and a publisher that is created
        with the first message loses it. An error of the observable, or a message of another type, is raised
        once out of the spinning of this node.

        :param options: further arguments of :meth:`rclpy.node.Node.create_publisher`. A subject makes an
            observable of the publisher's QoS events:
            ``event_callbacks=PublisherEventCallbacks(deadline=subject.on_next)``.
        """
        publisher = self.create_publisher(msg_type, topic, qos_profile, **options)
        subscription = observable.do_action(publisher.publish).subscribe(
            on_error=self.fail, scheduler=self.scheduler
        )

        def end() -> None:
            subscription.dispose()
            self.destroy_publisher(publisher)
            self._sinks.remove(sink)

        sink = Disposable(end)
        self._sinks.add(sink)
        return sink

    def fail(self, error: Exception) -> None:
        """Raise an error out of the spinning of this node, where it cannot be lost."""

        def throw(*_: Any) -> None:
            raise error

        self.scheduler.schedule(throw)

    def destroy_node(self) -> None:
        """End the node; its observables complete first."""
        if not self._end.is_stopped:
            self._end.on_next(None)
            self._end.on_completed()
            self._sinks.dispose()
            self.scheduler.dispose()
        super().destroy_node()
