"""A pytest plugin that drives recipes in virtual time, and nodes in a ROS domain of their own.

Load it with ``pytest_plugins = ["reactive_node.testing"]`` in ``conftest.py``.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Generic, TypeVar

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.node import Node
from reactivex import Observable
from reactivex.abc import DisposableBase
from reactivex.notification import OnNext
from reactivex.scheduler.scheduler import Scheduler
from reactivex.testing import Recorded, TestScheduler

from reactive_node.domains import reserved_domain
from reactive_node.executor import create_executor
from reactive_node.node import ReactiveNode

_T = TypeVar("_T")

MakeNode = Callable[..., Any]
"""The fixture ``make_node``: ``(name="node", kind=ReactiveNode, **options) -> node``."""
SpinUntil = Callable[..., None]
"""The fixture ``spin_until``: ``(condition, seconds=60.0) -> None``."""
SpinFor = Callable[[float], None]
"""The fixture ``spin_for``: ``(seconds) -> None``."""


@dataclass(frozen=True)
class Recording(Generic[_T]):
    """What an observable has emitted, in virtual time."""

    messages: list[Recorded[_T]]
    """Items, error and completion; compare with RxPY's ``ReactiveTest.on_next(1, item)`` and so on."""

    @property
    def items(self) -> list[tuple[float, _T]]:
        """The items, each with its time [s]; without error and completion."""
        return [
            (message.time, message.value.value)
            for message in self.messages
            if isinstance(message.value, OnNext)
        ]


class VirtualTime(TestScheduler):
    """RxPY's ``TestScheduler`` in seconds: time begins at 0 and passes only while it is advanced.

    A recipe under test is subscribed with :meth:`record`, its inputs are made with :meth:`hot`.
    """

    def hot(self, *items: tuple[float, Any]) -> Any:
        """Return a hot observable that emits each item at its time [s] and never ends.

        Its ``subscriptions`` hold the times of subscribing and disposing. For an input that fails or
        completes, use ``create_hot_observable``.
        """
        messages: Any = [Recorded(at, OnNext(item)) for at, item in items]  # type: ignore[arg-type]
        return self.create_hot_observable(messages)

    def record(self, observable: Observable[_T], *, until: float) -> Recording[_T]:
        """Subscribe now, let time pass, dispose at ``until`` [s], inclusive; return what was emitted."""
        observer = self.create_observer()
        subscription = observable.subscribe(observer, scheduler=self)
        self.advance_to(until)
        subscription.dispose()
        return Recording(observer.messages)

    def worker(self, seconds: float) -> Scheduler:
        """Return a scheduler for slow work: its actions run in parallel and end after ``seconds``."""
        return _SlowWorker(self, seconds)


class _SlowWorker(Scheduler):
    """Runs actions late, when they would have ended."""

    def __init__(self, time: VirtualTime, seconds: float) -> None:
        super().__init__()
        self._time = time
        self._seconds = seconds

    @property
    def now(self) -> datetime:
        return self._time.now

    def schedule(self, action: Any, state: Any = None) -> DisposableBase:
        return self.schedule_relative(0.0, action, state)

    def schedule_relative(self, duetime: Any, action: Any, state: Any = None) -> DisposableBase:
        return self._time.schedule_relative(self.to_seconds(duetime) + self._seconds, action, state)

    def schedule_absolute(self, duetime: Any, action: Any, state: Any = None) -> DisposableBase:
        return self._time.schedule_absolute(self.to_seconds(duetime) + self._seconds, action, state)


@pytest.fixture
def scheduler() -> VirtualTime:
    """Virtual time [s]."""
    return VirtualTime()


@pytest.fixture
def domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A free ROS domain; the environment selects it and keeps its traffic on this machine."""
    with reserved_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield domain


@pytest.fixture(scope="module")
def module_domain_id() -> Iterator[int]:
    """A free ROS domain that the tests of a module share; the environment does not change."""
    with reserved_domain() as domain:
        yield domain


@pytest.fixture
def context(domain_id: int) -> Iterator[Context]:
    """An initialized context in the test's domain; it handles no signals."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    yield context
    context.try_shutdown()
    context.destroy()


@pytest.fixture
def executor(context: Context) -> Iterator[Executor]:
    """The executor of the test's context, as services have it."""
    with create_executor(context) as executor:
        yield executor


@pytest.fixture
def make_node(context: Context, executor: Executor) -> Iterator[MakeNode]:
    """Makes nodes that the test's executor spins; they end with the test."""
    with ExitStack() as stack:

        def make(name: str = "node", kind: type[Node] = ReactiveNode, **options: Any) -> Node:
            node = kind(name, **{"context": context, **options})
            stack.callback(node.destroy_node)
            executor.add_node(node)
            return node

        yield make


@pytest.fixture
def spin_until(executor: Executor) -> SpinUntil:
    """Spins the test's executor until a condition is true; fails after ``seconds``."""

    def spin(condition: Callable[[], object], seconds: float = 60.0) -> None:
        deadline = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < deadline, f"the condition was not true within {seconds} s"
            executor.spin_once(timeout_sec=0.1)

    return spin


@pytest.fixture
def spin_for(executor: Executor) -> SpinFor:
    """Spins the test's executor for some seconds, to show that something does not happen."""

    def spin(seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            executor.spin_once(timeout_sec=left)

    return spin
