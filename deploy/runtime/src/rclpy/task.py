"""Results that come later, and the functions and coroutines that an executor runs to get them."""

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
    """
    A result that comes later, or an exception in its place; may be awaited in a coroutine callback.

    All methods may be called from any thread.
    """

    def __init__(self, *, executor: Executor | None = None) -> None:
        """Create a future whose done callbacks run on `executor`, or at once on the completing thread."""
        self._done = False
        self._cancelled = False
        self._result: Any = None
        self._exception: BaseException | None = None
        self._exception_fetched = False
        self._callbacks: list[Callable[[Any], Any]] = []
        # What must know at once, whatever executor there is: a task that awaits this future.
        self._waiters: list[Callable[[], None]] = []
        self._lock = threading.Lock()
        self._executor: Callable[[], Executor | None] = _no_executor
        self._set_executor(executor)

    def __del__(self) -> None:
        if self._exception is not None and not self._exception_fetched:
            print(f"The following exception was never retrieved: {self._exception}", file=sys.stderr)

    def __await__(self) -> Generator[None, None, Any]:
        while not self._is_over():
            # Told aside: asyncio, whose tasks may await this too, takes None for "again later".
            _running.awaited = self
            yield
        return self.result()

    def cancel(self) -> None:
        """
        Cancel, unless done already: done callbacks run, and who awaits the future gets `None`.

        `done()` stays `False`, as in rclpy.
        """
        with self._lock:
            if not self._done:
                self._cancelled = True
        self._complete()

    def cancelled(self) -> bool:
        """Tell whether the future was cancelled."""
        return self._cancelled

    def done(self) -> bool:
        """Tell whether there is a result or an exception."""
        return self._done

    def _is_over(self) -> bool:
        """Tell whether nobody needs to wait for it any more."""
        return self._done or self._cancelled

    def result(self) -> Any:
        """
        Return the result, `None` as long as there is none.

        :raises Exception: the exception that came in place of a result.
        """
        if self._exception is not None:
            self._exception_fetched = True
            raise self._exception
        return self._result

    def exception(self) -> BaseException | None:
        """Return the exception that came in place of a result, or `None`."""
        self._exception_fetched = True
        return self._exception

    def set_result(self, result: Any) -> None:
        """Complete with `result`."""
        with self._lock:
            self._result = result
            self._done = True
            self._cancelled = False
        self._complete()

    def set_exception(self, exception: BaseException) -> None:
        """Complete with an exception, which `result` will raise."""
        with self._lock:
            self._exception = exception
            self._exception_fetched = False
            self._done = True
            self._cancelled = False
        self._complete()

    def add_done_callback(self, callback: Callable[[Any], Any]) -> None:
        """
        Call `callback` with this future when it is done or cancelled, at once if it is done already.

        The callback runs as a task of the future's executor, if it has one; it should not raise.
        """
        with self._lock:
            if not self._done:
                self._callbacks.append(callback)
                return
            executor = self._executor()
        if executor is not None:
            executor.create_task(callback, self)
        else:
            callback(self)

    def _set_executor(self, executor: Executor | None) -> None:
        """Choose the executor for the done callbacks; it is not kept alive."""
        with self._lock:
            self._executor = _no_executor if executor is None else weakref.ref(executor)

    def _call_when_complete(self, waiter: Callable[[], None]) -> None:
        """Call `waiter` once, on the completing thread: when done or cancelled, at once if that is so."""
        with self._lock:
            if not self._is_over():
                # Who waits with a timeout comes again and again.
                if waiter not in self._waiters:
                    self._waiters.append(waiter)
                return
        waiter()

    def _complete(self) -> None:
        """Tell everybody who waits; the lock must not be held."""
        with self._lock:
            waiters, self._waiters = self._waiters, []
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
                # The other callbacks have a right to be called too.
                warnings.warn(f"Unhandled exception in done callback: {error}", stacklevel=2)


def _no_executor() -> None:
    return None


class _Running(threading.local):
    awaited: Future | None = None
    """what the coroutine that runs in this thread awaits now"""


_running = _Running()


class Task(Future):
    """
    A function or coroutine that an executor runs; the future of what it returns.

    Only executors create tasks: see `Executor.create_task`.
    """

    def __init__(
        self,
        handler: Callable[..., Any] | Coroutine[Any, Any, Any],
        args: Any = None,
        kwargs: dict[str, Any] | None = None,
        executor: Executor | None = None,
    ) -> None:
        """Create a task that calls `handler` (or drives it, if it is a coroutine) with these arguments."""
        super().__init__(executor=executor)
        self._handler: Any = handler
        self._args: Any = [] if args is None else args
        self._kwargs: dict[str, Any] = {} if kwargs is None else kwargs
        if inspect.iscoroutinefunction(handler):
            self._handler = handler(*self._args, **self._kwargs)
        # The future this task waits for between two calls; None: nothing keeps it from running on.
        self._awaited: Future | None = None
        self._executing = False
        # Keeps two threads from running the task at once.
        self._task_lock = threading.Lock()

    def __call__(self) -> None:
        """
        Run the function, or the coroutine to its next `await`, and store the outcome.

        Does nothing when the task is done, cancelled, or running on another thread.
        """
        if not self._task_lock.acquire(blocking=False):
            return
        try:
            if self._done or self._handler is None:
                return
            if self._cancelled:
                self._drop_handler()
                return
            self._executing = True
            if inspect.iscoroutine(self._handler):
                self._step(self._handler)
            else:
                self._run()
        finally:
            self._executing = False
            self._task_lock.release()

    def executing(self) -> bool:
        """Tell whether the task is running at this moment."""
        return self._executing

    def _run(self) -> None:
        handler, args, kwargs = self._handler, self._args, self._kwargs
        self._drop_handler()
        try:
            result = handler(*args, **kwargs)
        except Exception as error:
            self.set_exception(error)
        except BaseException:
            # KeyboardInterrupt or SystemExit end the spin; spinning again must not run the task again.
            self.cancel()
            raise
        else:
            self.set_result(result)

    def _step(self, coroutine: Coroutine[Any, Any, Any]) -> None:
        self._awaited = _running.awaited = None
        try:
            coroutine.send(None)
        except StopIteration as stop:
            self._drop_handler()
            self.set_result(stop.value)
        except Exception as error:
            self._drop_handler()
            self.set_exception(error)
        except BaseException:
            self._drop_handler()
            self.cancel()
            raise
        else:
            self._awaited, _running.awaited = _running.awaited, None

    def _drop_handler(self) -> None:
        """Let go of what the handler holds; a coroutine that was cancelled runs its `finally` clauses."""
        if inspect.iscoroutine(self._handler):
            self._handler.close()
        self._handler = None
        self._args = None
        self._kwargs = {}
