"""When the scenario begins: the parameter ``scenario_epoch``, the same for all processes."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TypeVar

import reactivex as rx
from reactivex import Observable

from interfaces.service import ServiceNode, parameter

T = TypeVar("T")


@dataclass(frozen=True)
class _Parameters:
    scenario_epoch: float = parameter(
        0.0,
        (0.0, 1e12),
        "s",
        "origin of the scenario by CLOCK_MONOTONIC of this host; 0 is the start of this process",
    )


class Origin:
    """The origin of the scenario's time."""

    def __init__(self, node: ServiceNode) -> None:
        """Declare the parameter on a node."""
        self._epoch = node.declare(_Parameters).scenario_epoch

    def elapsed(self) -> float:
        """Return the time since the origin [s]; negative before it."""
        return time.monotonic() - self._epoch if self._epoch else 0.0

    @property
    def is_past(self) -> bool:
        """Whether this process resumes a running scenario, in the place of a process that died."""
        return self.elapsed() > 0.0

    def delay_subscription(self, items: Observable[T]) -> Observable[T]:
        """Subscribe to an observable when the scenario begins, at once if it has begun."""
        return rx.defer(lambda _: items.delay_subscription(max(0.0, -self.elapsed())))
