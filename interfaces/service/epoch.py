"""The epoch: the origin of the time of the scenario, the same for all processes (``scenario_epoch``)."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TypeVar

import reactivex as rx
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from reactivex import Observable
from reactivex.subject import BehaviorSubject

from interfaces.service import ServiceNode, parameter

T = TypeVar("T")
EPOCH = "scenario_epoch"
_SOON = 1e-6  # s


@dataclass(frozen=True)
class _Parameters:
    scenario_epoch: float = parameter(
        0.0,
        (-1.0, 1e12),
        "s",
        "origin of the scenario by CLOCK_MONOTONIC of this host; 0 is the start of this process, "
        "-1 waits until the parameter is set",
        settable=True,
    )


class Epoch:
    """Gives a process the time when the scenario begins; the first value is final."""

    def __init__(self, node: ServiceNode) -> None:
        start = time.monotonic()
        epoch = node.declare(_Parameters).scenario_epoch
        self.is_past = 0.0 < epoch < start
        """Whether this process replaces one that died and resumes its scenario."""
        self._epochs = BehaviorSubject(-1.0)
        node.add_on_set_parameters_callback(self._check)
        node.create_parameter_observable(EPOCH).map(lambda it: it or start).subscribe(self._epochs)

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        epoch = self._epochs.value
        if epoch >= 0.0 and any(each.name == EPOCH and each.value != epoch for each in parameters):
            return SetParametersResult(successful=False, reason="the scenario has an origin already")
        return SetParametersResult(successful=True)

    @property
    def is_known(self) -> bool:
        """Whether the origin is known; before that the scenario has not begun."""
        return self._epochs.value >= 0.0

    def elapsed(self) -> float:
        """Return the time since the origin [s]; negative before it. The origin must be known."""
        return time.monotonic() - self._epochs.value

    def start(self, items: Observable[T]) -> Observable[T]:
        """Subscribe to an observable when the scenario begins, at once if it has begun."""
        # RxPY's delay_subscription schedules each item again, which doubles the cost of a source.
        known = self._epochs.filter(lambda epoch: epoch >= 0.0).take(1)
        # With a delay, it waits for the beginning of a simulation: the time of the scheduler jumps there.
        begun = known.flat_map(lambda _: rx.timer(max(_SOON, -self.elapsed())))
        return begun.flat_map(lambda _: items)
