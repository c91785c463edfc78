"""Futures, and tasks: functions and coroutines that an executor runs."""

from __future__ import annotations

import inspect
import sys
import threading
import warnings
import weakref
from collections.abc import Callable, Coroutine, Generator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rclpy.executors import Executor


class Future:
    """A future result or exception, for any thread. Coroutine callbacks can await it."""

    def __init__(self, *, executor: Executor | None = None) -> None:
        """Create a future. Its done callbacks run on `executor`, or without one on the completing thread."""
        self._rclpy_done = False
        self._rclpy_cancelled = False
        self._result: Any = None
        self._exception: BaseException | None = None
        self._exception_fetched = False
        self._callbacks: list[Callable[[Any], Any]] = []
        # Called on the completing thread, for example by tasks that await this future.
        self._rclpy_waiters: list[Callable[[], None]] = []
        self._lock = threading.Lock()
        self._executor: Callable[[], Executor | None] = _no_executor
        self._set_executor(executor)

    def __del__(self) -> None:
        if self._exception is not None and not self._exception_fetched:
            print(f"The following exception was never retrieved: {self._exception}", file=sys.stderr)

    def __await__(self) -> Generator[None, None, Any]:
        while not self._rclpy_is_over():
            # Not yielded: tasks of asyncio may also await this, and to them None means "call again".
            _running.awaited = self
            yield
        return self.result()

    def cancel(self) -> None:
        """Cancel unless done: callbacks run, awaiting gives `None`, `done()` stays `False`, as in rclpy."""
        with self._lock:
            if not self._rclpy_done:
                self._rclpy_cancelled = True
        self._rclpy_complete()

    def cancelled(self) -> bool:
        return self._rclpy_cancelled

    def done(self) -> bool:
        """Return whether there is a result or an exception."""
        return self._rclpy_done

    def _rclpy_is_over(self) -> bool:
        return self._rclpy_done or self._rclpy_cancelled

    def result(self) -> Any:
        """Return the result, or `None` before there is one. Raises the exception if there is one instead."""
        if self._exception is not None:
            self._exception_fetched = True
            raise self._exception
        return self._result

    def exception(self) -> BaseException | None:
        """Return the exception, or `None` if there is none."""
        self._exception_fetched = True
        return self._exception

    def set_result(self, result: Any) -> None:
        with self._lock:
            self._result = result
            self._rclpy_done = True
            self._rclpy_cancelled = False
        self._rclpy_complete()

    def set_exception(self, exception: BaseException) -> None:
        """Complete the future with an exception, which `result` raises."""
        with self._lock:
            self._exception = exception
            self._exception_fetched = False
            self._rclpy_done = True
            self._rclpy_cancelled = False
        self._rclpy_complete()

    def add_done_callback(self, callback: Callable[[Any], Any]) -> None:
        """Call `callback` with this future when it is done or cancelled, or now if it is done.

        The callback runs as a task of the future's executor, if there is one. It should not raise.
        """
        with self._lock:
            if not self._rclpy_done:
                self._callbacks.append(callback)
                return
            executor = self._executor()
        if executor is not None:
            executor.create_task(callback, self)
        else:
            callback(self)

    def remove_done_callback(self, callback: Callable[[Any], Any]) -> bool:
        """Undo :meth:`add_done_callback`; return whether the callback was still waiting."""
        with self._lock:
            if callback not in self._callbacks:
                return False
            self._callbacks.remove(callback)
            return True

    def _set_executor(self, executor: Executor | None) -> None:
        """Set the executor of the done callbacks, without keeping it alive."""
        with self._lock:
            self._executor = _no_executor if executor is None else weakref.ref(executor)

    def _rclpy_call_when_complete(self, waiter: Callable[[], None]) -> None:
        """Call `waiter` once: on the completing thread, or now if the future is done or cancelled."""
        with self._lock:
            if not self._rclpy_is_over():
                # A caller that waits with timeouts adds the same waiter repeatedly.
                if waiter not in self._rclpy_waiters:
                    self._rclpy_waiters.append(waiter)
                return
        waiter()

    def _rclpy_complete(self) -> None:
        """Call the waiters and callbacks; the caller must not hold the lock."""
        with self._lock:
            waiters, self._rclpy_waiters = self._rclpy_waiters, []
            callbacks, self._callbacks = self._callbacks, []
            executor = self._executor()
        for waiter in waiters:
            waiter()
        for callback in callbacks:
            if executor is not None:
                executor.create_task(callback, self)
                continue
            try:
                callback(self)
            except Exception as error:
                # The other callbacks must run, too.
                warnings.warn(f"Unhandled exception in done callback: {error}", stacklevel=2)


def _no_executor() -> None:
    return None


class _Running(threading.local):
    awaited: Future | None = None
    """The future that this thread's running coroutine awaits."""


_running = _Running()


class Task(Future):
    """A function or coroutine that an executor runs (`Executor.create_task`), and its future."""

    def __init__(
        self,
        handler: Callable[..., Any] | Coroutine[Any, Any, Any],
        args: Any = None,
        kwargs: dict[str, Any] | None = None,
        executor: Executor | None = None,
    ) -> None:
        """Create a task that calls `handler` with these arguments, or runs it if it is a coroutine."""
        super().__init__(executor=executor)
        self._handler: Any = handler
        self._args: Any = [] if args is None else args
        self._kwargs: dict[str, Any] = {} if kwargs is None else kwargs
        if inspect.iscoroutinefunction(handler):
            self._handler = handler(*self._args, **self._kwargs)
        # The future that this task awaits; None: the task can continue.
        self._rclpy_awaited: Future | None = None
        self._executing = False
        # Two threads must not run the task at the same time.
        self._task_lock = threading.Lock()

    def __call__(self) -> None:
        """Run the function, or the coroutine until its next `await`, and store the result or exception.

        Does nothing if the task is done, cancelled, or running on another thread.
        """
        if not self._task_lock.acquire(blocking=False):
            return
        waits = False
        try:
            if self._rclpy_done or self._handler is None:
                return
            if self._rclpy_cancelled:
                self._rclpy_drop_handler()
                return
            self._executing = True
            if inspect.iscoroutine(self._handler):
                self._rclpy_step(self._handler)
                waits = not self._rclpy_is_over()
            else:
                self._rclpy_run()
        finally:
            self._executing = False
            self._task_lock.release()
        # Without the lock: another thread may continue the task at once.
        if waits and (executor := self._executor()) is not None:
            executor._rclpy_continue_later(self)

    def _rclpy_can_run(self) -> bool:
        """Return whether calling the task would do something now."""
        awaited = self._rclpy_awaited
        ready = awaited is None or awaited._rclpy_is_over()
        return ready and not self._executing and not self._rclpy_is_over()

    def _rclpy_cancel_before_start(self) -> None:
        """Cancel a coroutine that has not started; others go on."""
        if inspect.iscoroutine(self._handler) and inspect.getcoroutinestate(self._handler) == "CORO_CREATED":
            self.cancel()
            self()  # closes the coroutine

    def executing(self) -> bool:
        """Return whether the task is running now."""
        return self._executing

    def _rclpy_run(self) -> None:
        handler, args, kwargs = self._handler, self._args, self._kwargs
        self._rclpy_drop_handler()
        try:
            result = handler(*args, **kwargs)
        except Exception as error:
            self.set_exception(error)
        except BaseException:
            # KeyboardInterrupt and SystemExit end spinning. Later spinning must not run the task again.
            self.cancel()
            raise
        else:
            self.set_result(result)

    def _rclpy_step(self, coroutine: Coroutine[Any, Any, Any]) -> None:
        self._rclpy_awaited = _running.awaited = None
        try:
            coroutine.send(None)
        except StopIteration as stop:
            self._rclpy_drop_handler()
            self.set_result(stop.value)
        except Exception as error:
            self._rclpy_drop_handler()
            self.set_exception(error)
        except BaseException:
            self._rclpy_drop_handler()
            self.cancel()
            raise
        else:
            self._rclpy_awaited, _running.awaited = _running.awaited, None

    def _rclpy_drop_handler(self) -> None:
        """Release the handler and its arguments; a cancelled coroutine runs its `finally` clauses."""
        if inspect.iscoroutine(self._handler):
            self._handler.close()
        self._handler = None
        self._args = None
        self._kwargs = {}
