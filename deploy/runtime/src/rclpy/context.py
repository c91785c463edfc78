"""Contexts: each is a life of rclpy, from ``init`` to ``shutdown``, in a DDS domain."""

from __future__ import annotations

import atexit
import inspect
import threading
import weakref
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from types import TracebackType
from typing import TYPE_CHECKING

from rclpy import logging, signals
from rclpy._arguments import RosArguments, parse
from rclpy._dds import domain
from rclpy._handle import Handle
from rclpy._listeners import Listeners
from rclpy.exceptions import NotInitializedException, RCLError

if TYPE_CHECKING:
    from rclpy._graph import Graph
    from rclpy.executors import Executor
    from rclpy.node import Node

g_logging_ref_count = 0
_logging_lock = threading.Lock()
_joined: set[Context] = set()


@atexit.register  # registered on import: exit handlers of users run earlier and may still publish
def _leave_domains() -> None:
    for context in list(_joined):
        context._rclpy_leave_domain()


class ContextHandle(Handle):
    def __init__(self, context: Context) -> None:
        self._rclpy_context = context

    def ok(self) -> bool:
        """Whether the context is initialized and not shut down."""
        return self._rclpy_context.ok()

    def get_domain_id(self) -> int:
        return self._rclpy_context.get_domain_id()

    def shutdown(self) -> None:
        """Shut down the context. Raises RCLError if it is not initialized or already shut down."""
        self._rclpy_context.shutdown()


class Context(AbstractContextManager["Context"]):
    """The shared state of nodes: arguments, DDS domain, and whether rclpy is shut down.

    A ``with`` initializes the context and shuts it down at its end.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._rclpy_initialized = False
        self._rclpy_valid = False
        self._rclpy_ended_by_signal = False
        self._rclpy_logging = False
        self._rclpy_domain_id = 0
        self._rclpy_arguments = RosArguments()
        self._callbacks: list[Callable[[], Callable[[], None] | None]] = []  # references to them
        self._rclpy_nodes: weakref.WeakSet[Node] = weakref.WeakSet()
        self._rclpy_executors: Listeners[Executor] = Listeners()
        self._rclpy_events: Listeners[threading.Event] = Listeners()
        self._rclpy_graph: Graph | None = None

    @property
    def handle(self) -> ContextHandle:
        """A handle for the context. Raises NotInitializedException before ``init``."""
        self._rclpy_check_initialized()
        return ContextHandle(self)

    def _rclpy_check_initialized(self) -> None:
        if not self._rclpy_initialized:
            raise NotInitializedException("Context.init() must be called first")

    def init(
        self,
        args: list[str] | None = None,
        *,
        initialize_logging: bool = True,
        domain_id: int | None = None,
    ) -> None:
        """Initialize the context.

        :param args: command line arguments, ``sys.argv`` if ``None``; ROS arguments follow ``--ros-args``.
        :param initialize_logging: whether the arguments configure logging, unless another context did.
        :param domain_id: DDS domain; by default the value of ``ROS_DOMAIN_ID``.
        :raises RuntimeError: if the context is already initialized, or an argument is invalid.
        """
        with self._lock:
            if self._rclpy_initialized:
                raise RuntimeError("Context.init() must only be called once")
            if domain_id is not None and domain_id < 0:
                raise RuntimeError(f"domain id ({domain_id}) should not be lower than zero.")
            self._rclpy_arguments = parse(args)
            self._rclpy_domain_id = domain.domain_id_from_environment() if domain_id is None else domain_id
            domain.configuration()  # reports errors in the environment now, not with the first node
            self._rclpy_initialized = self._rclpy_valid = True
            signals._shut_down_by_signal(self)
            if initialize_logging:
                self._rclpy_initialize_logging()

    def _rclpy_initialize_logging(self) -> None:
        global g_logging_ref_count
        with _logging_lock:
            if not g_logging_ref_count:  # logging belongs to the process: the first context configures it
                logging._apply_arguments(self._rclpy_arguments)
            g_logging_ref_count += 1
        self._rclpy_logging = True

    def ok(self) -> bool:
        """Whether the context is initialized and not shut down."""
        return self._rclpy_valid

    def get_domain_id(self) -> int:
        """Return the DDS domain. Raises NotInitializedException before ``init``."""
        self._rclpy_check_initialized()
        return self._rclpy_domain_id

    def on_shutdown(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` at shutdown, or now after it. A bound method does not keep its object alive."""
        if not callable(callback):
            raise TypeError("callback should be callable, got {}", type(callback))
        with self._lock:
            if self._rclpy_initialized and not self._rclpy_valid:
                callback()
            elif inspect.ismethod(callback):  # only methods written in Python have weak references
                self._callbacks.append(weakref.WeakMethod(callback, self._rclpy_forget_callback))
            else:
                self._callbacks.append(lambda: callback)

    def _rclpy_forget_callback(self, reference: Callable[[], Callable[[], None] | None]) -> None:
        with suppress(ValueError):  # the shutdown takes all callbacks
            self._callbacks.remove(reference)

    def shutdown(self) -> None:
        """Shut down: waiting calls end, new ones are not possible. Raises RCLError if it does not run."""
        if not self._rclpy_end():
            if self._rclpy_initialized:
                raise RCLError("failed to shutdown: rcl_shutdown already called on the given context")
            raise RCLError("Context must be initialized before it can be shutdown")

    def try_shutdown(self) -> None:
        """Shut down unless the context is not initialized or already shut down."""
        self._rclpy_end()

    def destroy(self) -> None:
        """Shut down, and leave the DDS domain even if nodes still exist."""
        self._rclpy_end()
        self._rclpy_leave_domain()

    def _rclpy_end(self, by_signal: bool = False) -> bool:
        with self._lock:
            if not self._rclpy_valid:
                return False
            self._rclpy_ended_by_signal = by_signal
            self._rclpy_valid = False
            callbacks, self._callbacks = self._callbacks, []
        for event in self._rclpy_events:
            event.set()
        for executor in self._rclpy_executors:
            executor.wake()
        for reference in callbacks:
            if (callback := reference()) is not None:
                callback()
        if self._rclpy_logging:
            global g_logging_ref_count
            with _logging_lock:
                g_logging_ref_count -= 1
        self._rclpy_leave_if_unused()
        return True

    def __enter__(self) -> Context:
        """Initialize with the arguments of the command line. To use others, call :meth:`init` instead."""
        self.init()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_val: BaseException | None,
        exc_tb: TracebackType | None,
    ) -> None:
        self.try_shutdown()

    # Used by nodes and executors

    def _rclpy_wake_on_shutdown(self, event: threading.Event) -> None:
        self._rclpy_events.add(event)
        if not self._rclpy_valid:
            event.set()

    def _rclpy_join_domain(self, node: Node) -> Graph:
        """Register a node; the first one makes the process join the DDS domain."""
        from rclpy._graph import Graph

        with self._lock:
            if not self._rclpy_valid:
                raise NotInitializedException("cannot create node")
            if self._rclpy_graph is None:
                self._rclpy_graph = Graph(self._rclpy_domain_id, self._rclpy_arguments.enclave)
                _joined.add(self)
            self._rclpy_nodes.add(node)
            return self._rclpy_graph

    def _rclpy_forget(self, node: Node) -> None:
        with self._lock:
            self._rclpy_nodes.discard(node)
            self._rclpy_leave_if_unused()

    def _rclpy_leave_if_unused(self) -> None:
        """Leave the DDS domain if the context was shut down and has no nodes."""
        with self._lock:
            if not self._rclpy_valid and not list(
                self._rclpy_nodes
            ):  # a WeakSet's length includes dying nodes
                self._rclpy_leave_domain()

    def _rclpy_leave_domain(self) -> None:
        with self._lock:
            graph, self._rclpy_graph = self._rclpy_graph, None
            if graph is not None:
                _joined.discard(self)
                graph.close()
