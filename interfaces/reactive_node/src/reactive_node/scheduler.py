"""An Rx scheduler that runs operators on a node's executor, by the node's clock.

RxPY's own schedulers start a thread per event or follow the wall clock; setting that back stops their
``timeout`` and ``interval``. This scheduler is a heap of actions, ordered by their time, and one ROS timer,
armed for the earliest.
"""

from __future__ import annotations

import heapq
import itertools
import threading
import time
from datetime import datetime
from typing import Any, TypeVar

from rclpy.clock import Clock, ClockType, JumpThreshold, ROSClock, TimeJump
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.time import Time
from rclpy.timer import Timer
from reactivex import abc, typing
from reactivex.scheduler.periodicscheduler import PeriodicScheduler

from reactive_node import stamps

_TState = TypeVar("_TState")
_CATCH_UP = 50_000_000  # [ns]: a periodic action that is less late keeps its rate
_NOT_HEARD = Time(clock_type=ClockType.ROS_TIME)  # simulated time before the first message on /clock
_LONGEST_SLEEP = 86_400 * 10**9  # [ns]: ROS adds it to the time of day, in 64 bits
_LATE = 1_000_000  # [ns] that the process may stand still while it sets the timer
_FEW = 64  # cancelled items in the heap that are not worth a clean-up


class _Item(abc.DisposableBase):
    """A scheduled action; disposing it cancels the action, or disposes the result of the action."""

    __slots__ = ("action", "cancelled", "due", "result", "scheduler", "state")
    due: int  # [ns]
    state: Any

    def __init__(self, scheduler: NodeScheduler) -> None:
        self.scheduler = scheduler
        self.action: Any = None  # None while the item is not in the heap
        self.cancelled = False
        self.result: abc.DisposableBase | None = None

    def dispose(self) -> None:
        result = self.scheduler._cancel(self)
        if result is not None:
            result.dispose()


class NodeScheduler(PeriodicScheduler):
    """Schedules on a node's executor; any thread may schedule and cancel.

    Time is monotonic: it begins with the time of day and then follows the steady clock, so setting the
    machine's clock changes nothing. While the node's ROS time is simulated (``use_sim_time``), this time
    follows it, and begins with it if it is simulated from the start. When simulated time jumps back, begins
    or ends, a pending action keeps its remaining delay. An action without delay does not wait for a
    simulation that stands still.
    """

    is_simulated: bool
    """Whether ROS time is simulated; otherwise it is the time of day."""
    _before_jump: int  # [ns]

    def __init__(self, node: Node, *, steady: bool = False) -> None:
        """:param steady: whether its time follows the steady clock even while ROS time is simulated."""
        super().__init__()
        self._node = node
        self._is_steady = steady
        self._lock = threading.RLock()
        self._heap: list[tuple[int, int, _Item]] = []  # due time [ns], order of scheduling, item
        self._cancelled = 0  # number of cancelled items in the heap
        self._orders = itertools.count()
        self._armed_for: int | None = None
        self._disposed = False
        self._offset = 0  # [ns]: this scheduler's time minus the clock's time
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._note_source()
        self._use_clock(self._time_is_simulated())
        if not self._simulated:
            self._offset = time.time_ns() - self._read()
        self._jumps = node.get_clock().create_jump_callback(
            JumpThreshold(min_forward=Duration(nanoseconds=1), min_backward=Duration(nanoseconds=-1)),
            pre_callback=self._time_will_jump,
            post_callback=self._time_has_jumped,
        )

    # The interface of Rx schedulers

    @property
    def now(self) -> datetime:
        return stamps.from_nanoseconds(self._read())

    @property
    def kept(self) -> int:
        """How many actions it keeps: those that wait, and cancelled ones until the next clean-up."""
        return len(self._heap)

    def time_of_stamps(self) -> int:
        """Return the ROS time, by which the stamps of headers count [ns]; it may be set."""
        if not self.is_simulated:
            return time.time_ns()  # rclpy's clock takes six calls
        return int(self._node.get_clock().now().nanoseconds)

    def schedule(
        self, action: typing.ScheduledAction[_TState], state: _TState | None = None
    ) -> abc.DisposableBase:
        """Run an action as soon as the executor is free; never inside this call."""
        return self._schedule(self._read(), action, state)

    def schedule_relative(
        self,
        duetime: typing.RelativeTime,
        action: typing.ScheduledAction[_TState],
        state: _TState | None = None,
    ) -> abc.DisposableBase:
        """Run an action in ``duetime`` [s, or a timedelta]."""
        return self._schedule(self._read() + max(0, round(self.to_seconds(duetime) * 1e9)), action, state)

    def schedule_absolute(
        self,
        duetime: typing.AbsoluteTime,
        action: typing.ScheduledAction[_TState],
        state: _TState | None = None,
    ) -> abc.DisposableBase:
        """Run an action at ``duetime`` [a datetime like :attr:`now`, or seconds since 1970]."""
        return self._schedule(stamps.to_nanoseconds(self.to_datetime(duetime)), action, state)

    def schedule_periodic(
        self,
        period: typing.RelativeTime,
        action: typing.ScheduledPeriodicAction[_TState],
        state: _TState | None = None,
    ) -> abc.DisposableBase:
        """Run an action every ``period``, without drift; skip runs that are more than 50 ms late."""
        nanoseconds = max(1, round(self.to_seconds(period) * 1e9))

        def run(_: abc.SchedulerBase, state: Any) -> None:
            following = action(state)
            late = self._read() - item.due
            missed = late // nanoseconds if late > _CATCH_UP else 0
            self._put(item, item.due + (missed + 1) * nanoseconds, run, following)

        with self._lock:  # the first run needs `item`
            item = self._schedule(self._read() + nanoseconds, run, state)
        return item

    # The heap

    def _schedule(self, due: int, action: Any, state: Any) -> _Item:
        item = _Item(self)
        self._put(item, due, action, state)
        return item

    def _put(self, item: _Item, due: int, action: Any, state: Any) -> None:
        with self._lock:
            if item.cancelled or self._disposed:
                return
            item.due, item.action, item.state = due, action, state
            heapq.heappush(self._heap, (due, next(self._orders), item))
            if self._heap[0][2] is item:
                self._arm()

    def _cancel(self, item: _Item) -> abc.DisposableBase | None:
        """Cancel an item; return the result of its action, if that has run."""
        with self._lock:
            item.cancelled = True
            if item.action is not None:
                item.action = item.state = None
                self._cancelled += 1
                if self._cancelled > _FEW and 2 * self._cancelled > len(self._heap):
                    self._heap = [entry for entry in self._heap if not entry[2].cancelled]
                    heapq.heapify(self._heap)
                    self._cancelled = 0
            result, item.result = item.result, None
            return result

    def _run(self) -> None:
        """Run the due actions; actions that they schedule wait until the executor has done other work."""
        horizon, limit = self._read(), next(self._orders)
        try:
            while (due := self._pop(horizon, limit)) is not None:
                item, action, state = due
                result = action(self, state)
                if isinstance(result, abc.DisposableBase):
                    self._keep(item, result)
        finally:
            with self._lock:
                self._armed_for = None
                self._arm()

    def _pop(self, horizon: int, limit: int) -> tuple[_Item, Any, Any] | None:
        """Take out the first item, if it is due by `horizon` [ns] and was scheduled before `limit`."""
        with self._lock:
            while self._heap and self._heap[0][0] <= horizon and self._heap[0][1] < limit:
                item = heapq.heappop(self._heap)[2]
                if not item.cancelled:
                    action, state = item.action, item.state
                    item.action = item.state = None
                    return item, action, state
                self._cancelled -= 1
        return None

    def _keep(self, item: _Item, result: abc.DisposableBase) -> None:
        with self._lock:
            if not item.cancelled:
                item.result = result
                return
        result.dispose()

    # The timer

    def _arm(self) -> None:
        if self._disposed:
            return
        if not self._heap:
            self._timer.cancel()
            self._armed_for = None
            return
        due = self._heap[0][0]
        if self._armed_for is not None and self._armed_for <= due:
            return  # at worst it fires early and is armed again
        self._armed_for = due
        while True:
            now = self._read()
            self._timer.timer_period_ns = min(max(0, due - now), _LONGEST_SLEEP)
            self._timer.reset()  # wakes a waiting executor
            if self._read() - now < _LATE:  # else the period begins too late
                break

    # The clock

    def _note_source(self) -> None:
        clock = self._node.get_clock()
        self.is_simulated = isinstance(clock, ROSClock) and bool(clock.ros_time_is_active)

    def _use_clock(self, simulated: bool) -> None:
        self._simulated = simulated
        self._clock = self._node.get_clock() if simulated else self._steady
        self._timer: Timer = self._node.create_timer(1.0, self._run, clock=self._clock, autostart=False)

    def _read(self) -> int:
        # In real time, read `time.monotonic_ns` directly, as above.
        now = int(self._clock.now().nanoseconds) if self._simulated else time.monotonic_ns()
        return now + self._offset

    def _time_is_simulated(self) -> bool:
        return self.is_simulated and not self._is_steady

    def _time_will_jump(self) -> None:
        self._before_jump = self._read()

    def _time_has_jumped(self, jump: TimeJump) -> None:
        """Continue this scheduler's time without a jump back, by the same clock or by another one."""
        self._note_source()
        with self._lock:
            if self._disposed:
                return
            simulated = self._time_is_simulated()
            if simulated != self._simulated:
                # The jump's delta does not help: ROS 2 leaves it at 0 where simulated time begins or ends.
                self._node.destroy_timer(self._timer)
                self._use_clock(simulated)
                self._offset += self._before_jump - self._read()
            elif not simulated:
                return
            elif jump.delta.nanoseconds < 0:
                self._offset -= jump.delta.nanoseconds
            elif self._node.get_clock().now() == _NOT_HEARD + jump.delta:
                self._begin_simulation(jump.delta.nanoseconds)
            else:
                return  # time goes on; the timer sees that
            self._armed_for = None
            self._arm()

    def _begin_simulation(self, delta: int) -> None:
        """Follow the first simulated time; until then that clock stood at 0."""
        if self._offset:  # this time had begun before: it continues
            self._offset -= delta
            return
        self._heap = [(due + delta, order, item) for due, order, item in self._heap]
        for _, _, item in self._heap:
            item.due += delta

    def dispose(self) -> None:
        """Drop all actions, now and later: the node ends."""
        with self._lock:
            self._disposed = True
            self._heap.clear()
            self._jumps.unregister()
        self._node.destroy_timer(self._timer)
