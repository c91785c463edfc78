"""What EventsExecutor sees instead of a node and its entities: they hide its faults from their callbacks.

It reads attributes by their names, calls a callback although its entity was destroyed while the call waited,
hands the info of a message over in one argument with the message, and awaits no coroutine.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any

from rclpy.event_handler import EventHandler
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from rclpy.waitable import Waitable

from reactive_node import request_memory

CreateTask = Callable[..., Any]
"""Runs a coroutine by the executor."""


class _NoNode:
    """A node without entities."""

    subscriptions = timers = clients = services = waitables = guards = ()

    @property
    def executor(self) -> None:
        """None: EventsExecutor sets itself, and nothing would break that cycle of references."""

    @executor.setter
    def executor(self, executor: Any) -> None:
        pass


NO_NODE = _NoNode()


class Window(_NoNode):
    """The entities of a node that its callback groups let the executor run."""

    def __init__(self, node: Node, create_task: CreateTask) -> None:
        self._node = node
        self._create_task = create_task
        self._stand_ins: dict[type, dict[Any, Any]] = {}
        self._events: list[Any] | None = None  # None after a change of entities

    def refresh(self) -> None:
        """See which entities the node has now.

        This takes the place of a look at each call: nothing else destroys a subscription or timer of a node.
        """
        for kind, entities in ((_Reader, self._node.subscriptions), (_Timer, self._node.timers)):
            present = set(entities)
            for entity, stand_in in self._stand_ins.get(kind, {}).items():
                stand_in.lives = entity in present
        self._events = None

    def take_events(self) -> None:
        """Call the callbacks of QoS events that have come.

        EventsExecutor must not see them: an event that is on its way while its endpoint is destroyed is a
        segmentation fault (ros2/rclpy#1644).
        """
        events = self._events
        if events is None:
            handlers = [each for each in self._node.waitables if isinstance(each, EventHandler)]
            events = self._events = self._seen(_Event, handlers)
        for event in events:
            event.take()

    @property
    def subscriptions(self) -> list[Any]:  # type: ignore[override]
        return self._seen(_Reader, self._node.subscriptions)

    @property
    def timers(self) -> list[Any]:  # type: ignore[override]
        return self._seen(_Timer, self._node.timers)

    @property
    def clients(self) -> list[Any]:  # type: ignore[override]
        return [*self._node.clients]

    @property
    def services(self) -> list[Any]:  # type: ignore[override]
        return self._seen(_Server, self._node.services)

    @property
    def waitables(self) -> list[Any]:  # type: ignore[override]
        waitables = [each for each in self._node.waitables if not isinstance(each, EventHandler)]
        return self._seen(_Waitable, waitables)

    @property
    def guards(self) -> list[Any]:  # type: ignore[override]
        return [*self._node.guards]

    def get_logger(self) -> _Mute:
        """Return a logger that logs nothing: an error of a callback comes out of spinning."""
        return _Mute()

    def _seen(self, kind: type, entities: Iterable[Any]) -> list[Any]:
        """Return one stand-in for the whole life of each entity: EventsExecutor holds no reference to it."""
        known = self._stand_ins.get(kind, {})
        self._stand_ins[kind] = {
            entity: known.get(entity) or kind(entity, self._create_task)
            for entity in entities
            if entity.callback_group.can_execute(entity)
        }
        return [*self._stand_ins[kind].values()]


class _Mute:
    def fatal(self, text: str) -> None:
        pass

    warn = fatal


def _lives(entity: Any) -> bool:
    try:
        with entity.handle:
            return True
    except InvalidHandle:
        return False


class _Reader:
    """A subscription that always asks for the info of a message: its callback may be replaced."""

    # The values of an Enum cost a call for each message.
    CallbackType = SimpleNamespace(MessageOnly=SimpleNamespace(value=0))
    _callback_type = SimpleNamespace(value=1)  # WithMessageInfo

    def __init__(self, subscription: Subscription, create_task: CreateTask) -> None:
        self.handle = subscription.handle
        self.msg_type = subscription.msg_type
        self.raw = subscription.raw
        self.lives = True
        only = Subscription.CallbackType.MessageOnly

        def callback(*taken: Any) -> None:  # every message takes this path
            if not self.lives:
                return
            message, info = taken if len(taken) == 2 else taken[0]
            if subscription._callback_type is only:
                result = subscription.callback(message)
            else:
                result = subscription.callback(message, info)
            if result is not None and inspect.iscoroutine(result):
                create_task(result)

        self.callback = callback


class _Timer:
    def __init__(self, timer: Timer, create_task: CreateTask) -> None:
        self.handle = timer.handle
        self.lives = True
        self._timer = timer

    def callback(self) -> Any:
        return self._timer.callback() if self.lives else None


class _Server:
    def __init__(self, service: Service, create_task: CreateTask) -> None:
        self.handle = service.handle
        self._service = service
        self._is_of_parameters = service.srv_type.__module__.startswith("rcl_interfaces.")
        self._create_task = create_task
        self.callback = self._call  # an attribute of the object: EventsExecutor holds no reference to it

    @property
    def srv_type(self) -> Any:
        """The type of the service: EventsExecutor asks for it just before it takes requests."""
        if self._is_of_parameters:
            request_memory.limit()
        return self._service.srv_type

    def _call(self, request: Any, response: Any) -> Any:
        request_memory.free()
        return self._service.callback(request, response) if _lives(self._service) else None

    def send_response(self, response: Any, header: Any) -> None:
        if inspect.iscoroutine(response):
            self._create_task(self._send_later(response, header))
        elif response is not None or _lives(self._service):
            self._service.send_response(response, header)
        if self._is_of_parameters:  # the next request may be on its way
            request_memory.limit()

    async def _send_later(self, response: Any, header: Any) -> None:
        self._service.send_response(await response, header)


class _Event:
    """A kind of QoS events of an endpoint. It plays the wait set in which they are always ready."""

    def __init__(self, handler: EventHandler, create_task: CreateTask) -> None:
        self._handler = handler
        self._create_task = create_task
        self._changes: list[str] | None = None  # the names of the numbers that count changes

    def take(self) -> None:
        try:
            if self._changes is None:
                self._handler.add_to_wait_set(self)
            self._handler.is_ready(self)
            status = self._handler.take_data()
        except InvalidHandle:
            return
        if self._changes is None:
            self._changes = [name for name in dir(status) if name.endswith("_change")]
        for name in self._changes:
            if getattr(status, name):
                self._create_task(self._handler.execute(status))
                return

    def add_event(self, event: Any) -> int:
        return 0

    def is_ready(self, kind: str, index: int) -> bool:
        return True


class _Waitable:
    def __init__(self, waitable: Waitable, create_task: CreateTask) -> None:
        self._waitable = waitable
        self._create_task = create_task

    def __getattr__(self, name: str) -> Any:
        return getattr(self._waitable, name)

    def take_data(self) -> Any:
        """Take what has come; None if the waitable was destroyed since."""
        try:
            return self._waitable.take_data()
        except InvalidHandle:
            return None

    async def execute(self, taken_data: Any) -> None:
        if taken_data is not None:
            self._create_task(self._waitable.execute(taken_data))
