"""Topics as observables, observables as topics (thesis chapter 4).

A :class:`ReactiveNode` is a node like any other that can also hand out observables, as in Listings 4.3 to
4.5::

    node = ReactiveNode("node_name")
    observable = node.create_observable(String, "topic")
    observable.subscribe(print, scheduler=node.scheduler)
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

import reactivex as rx
from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from rclpy.subscription import Subscription
from rclpy.task import Future
from reactivex import Observable, abc
from reactivex.disposable import Disposable
from reactivex.subject import AsyncSubject

from reactive_node import stamps
from reactive_node.scheduler import NodeScheduler
from reactive_node.stamps import Timestamp

_SERVER_POLL = 0.05  # [s]: ROS does not tell when a server appears
_STEADY = Clock(clock_type=ClockType.STEADY_TIME)


class ReactiveNode(Node):
    """A node whose topics, parameters, QoS events and calls are observables, and that publishes such."""

    def __init__(self, node_name: str, **options: Any) -> None:
        """Create a node; the options are those of :class:`rclpy.node.Node`."""
        super().__init__(node_name, **options)
        self._readers: set[_SharedReader] = set()
        self._sinks: set[Disposable] = set()
        self._ended = False
        self._end: AsyncSubject[None] = AsyncSubject()
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

        Nothing is on the network before the first observer subscribes. All observers share one DDS reader,
        the last one that leaves ends it, and the next one gets another. A further observer of a
        transient-local topic first gets what the reader has kept, like the observer of a reader of its own
        (not with BEST_AVAILABLE durability: what becomes of it, a reader does not tell).
        When the node ends, the observable completes. Subscribing and disposing are safe on any thread, also
        inside a callback.

        :param timestamped: whether items are :class:`Timestamp` s, that hold a message and its DDS source
        time,
            instead of messages.
        :param options: further arguments of :meth:`rclpy.node.Node.create_subscription`.
        """

        def create_reader(callback: Callable[..., None]) -> Subscription:
            return self.create_subscription(msg_type, topic, callback, qos_profile, **options)

        return Observable(_SharedReader(self, create_reader, _retained(qos_profile), timestamped).subscribe)

    def create_parameter_observable(self, name: str) -> Observable[Any]:
        """
        Return the values of a declared parameter: the present one at once, then each that is set.

        One that is set just then, on another thread or by another observer, may come twice.
        """

        def subscribe(
            observer: abc.ObserverBase[Any], scheduler: abc.SchedulerBase | None = None
        ) -> abc.DisposableBase:
            lock = threading.RLock()  # the present value comes first, whoever sets another one meanwhile

            def changed(parameters: list[Parameter]) -> None:
                with lock:
                    if any(parameter.name == name for parameter in parameters):
                        # Not the one that was set: who has heard of it before us may have set another one.
                        observer.on_next(self.get_parameter(name).value)

            end = Disposable(lambda: self.remove_post_set_parameters_callback(changed))
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
        Return what happens to a subscription by its QoS as an observable, cold and shared.

        :param event: ``deadline``, ``liveliness``, ``message_lost``, ``incompatible_qos``,
            ``incompatible_type`` or ``matched``: see :class:`rclpy.event_handler.SubscriptionEventCallbacks`.
        """

        def create_reader(callback: Callable[..., None]) -> Subscription:
            callbacks: dict[str, Any] = {event: callback}
            events = SubscriptionEventCallbacks(**callbacks)
            return self.create_subscription(
                msg_type, topic, lambda _: None, qos_profile, event_callbacks=events
            )

        return Observable(_SharedReader(self, create_reader, None, timestamped=False).subscribe)

    def create_call(
        self, srv_type: Any, srv_name: str, *, timeout: float | None = None, **options: Any
    ) -> Callable[[Any], Observable[Any]]:
        """
        Return a function from a request to an observable of the response, for ``requests.flat_map(call)``.

        A call begins when it is subscribed to, waits for a server if there is none, and blocks nothing;
        disposing gives it up.

        :param timeout: with no response within so many seconds, the observable ends in a TimeoutError.
        :param options: further arguments of :meth:`rclpy.node.Node.create_client`.
        """
        client = self.create_client(srv_type, srv_name, **options)
        late = rx.throw(TimeoutError(f"no response of {srv_name} within {timeout} s"))

        def call(request: Any) -> Observable[Any]:
            def send(
                observer: abc.ObserverBase[Any], scheduler: abc.SchedulerBase | None = None
            ) -> abc.DisposableBase:
                def done(future: Future) -> None:
                    try:
                        response = future.result()
                    except Exception as error:
                        observer.on_error(error)
                    else:
                        observer.on_next(response)
                        observer.on_completed()

                future = client.call_async(request)
                # A future's callbacks belong to no callback group, what else happens to this node does.
                future.add_done_callback(lambda future: self.scheduler.schedule(lambda *_: done(future)))
                return Disposable(lambda: client.remove_pending_request(future))

            ready = self._when_ready(client)
            response = ready.take(1).flat_map(lambda _: Observable(send)).take_until(self._end)
            return response if timeout is None else response.timeout(timeout, late, self.scheduler)

        return call

    def _when_ready(self, client: Client) -> Observable[None]:
        """Emit as soon as there is a server; one appears by real time, also while ROS time is simulated."""

        def subscribe(
            observer: abc.ObserverBase[None], scheduler: abc.SchedulerBase | None = None
        ) -> abc.DisposableBase:
            def look() -> None:
                if client.service_is_ready():
                    observer.on_next(None)

            timer = self.create_timer(_SERVER_POLL, look, clock=_STEADY)
            self.scheduler.schedule(lambda *_: look())

            def end() -> None:
                self.destroy_timer(timer)

            return Disposable(end)

        return Observable(subscribe)

    def publish_observable(
        self,
        observable: Observable[Any],
        msg_type: Any,
        topic: str,
        qos_profile: QoSProfile | int = 10,
        **options: Any,
    ) -> abc.DisposableBase:
        """
        Publish every message of an observable, until the returned disposable is disposed or the node ends.

        The publisher exists from now on: peers need time to discover it, so one that is created with the
        first message loses it. An error of the observable, or a message of another type, ends the spinning of
        the node: it is raised there, once.

        :param options: further arguments of :meth:`rclpy.node.Node.create_publisher`. The QoS events of the
            publisher are an observable by a subject:
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
        """Raise an error where it cannot be lost: out of the spinning of this node."""

        def throw(*_: Any) -> None:
            raise error

        self.scheduler.schedule(throw)

    def destroy_node(self) -> None:
        """End the node; its observables complete first."""
        if not self._ended:
            self._ended = True
            self._end.on_next(None)
            self._end.on_completed()
            for reader in list(self._readers):
                reader.complete()
            for sink in list(self._sinks):
                sink.dispose()
            self.scheduler.dispose()
        super().destroy_node()


def _retained(qos_profile: QoSProfile | int) -> deque[Any] | None:
    """Return a place for the samples that a reader keeps for late observers, ``None`` if it keeps none."""
    if isinstance(qos_profile, int) or qos_profile.durability != DurabilityPolicy.TRANSIENT_LOCAL:
        return None
    return deque(maxlen=None if qos_profile.history == HistoryPolicy.KEEP_ALL else qos_profile.depth)


class _SharedReader:
    """The one DDS reader behind an observable, while somebody observes it."""

    def __init__(
        self,
        node: ReactiveNode,
        create: Callable[[Callable[..., None]], Subscription],
        retained: deque[Any] | None,
        timestamped: bool,
    ) -> None:
        self._node = node
        self._create = create
        self._retained = retained
        self._callback = self._receive_with_info if timestamped else self._receive
        self._lock = threading.RLock()
        self._subscription: Subscription | None = None
        self._members: list[abc.ObserverBase[Any]] = []
        self._listening: tuple[
            abc.ObserverBase[Any], ...
        ] = ()  # replaced, never changed: read without the lock

    def subscribe(
        self, observer: abc.ObserverBase[Any], scheduler: abc.SchedulerBase | None = None
    ) -> abc.DisposableBase:
        with self._lock:
            if self._node._ended:
                observer.on_completed()
                return Disposable()
            self._members.append(observer)
            if self._subscription is None:
                self._listening = (observer,)
                try:
                    self._subscription = self._create(self._callback)
                except Exception:
                    self._members, self._listening = [], ()
                    raise
                self._node._readers.add(self)
            elif self._retained is None:
                self._listening += (observer,)
            else:  # on the executor's thread, so that no message slips between the retained ones and the next
                self._node.scheduler.schedule(lambda *_: self._join(observer))
        return Disposable(lambda: self._leave(observer))

    def _join(self, observer: abc.ObserverBase[Any]) -> None:
        with self._lock:
            if self._subscription is None or not any(member is observer for member in self._members):
                return
            self._listening += (observer,)
            # What a publisher has published dies with it.
            alive = self._subscription.get_publisher_count() > 0
            retained = tuple(self._retained) if self._retained and alive else ()
        for item in retained:
            observer.on_next(item)

    def _receive(self, item: Any) -> None:
        if self._retained is not None:
            self._retained.append(item)
        for observer in self._listening:
            observer.on_next(item)

    def _receive_with_info(self, message: Any, info: Any) -> None:
        self._receive(Timestamp(message, stamps.from_nanoseconds(info["source_timestamp"])))

    def _leave(self, observer: abc.ObserverBase[Any]) -> None:
        with self._lock:
            self._members = [member for member in self._members if member is not observer]
            self._listening = tuple(member for member in self._listening if member is not observer)
            if self._members or self._subscription is None:
                return
            subscription, self._subscription = self._subscription, None
            if self._retained is not None:
                self._retained.clear()
            self._node._readers.discard(self)
            self._node.destroy_subscription(subscription)

    def complete(self) -> None:
        for observer in list(self._members):
            observer.on_completed()
