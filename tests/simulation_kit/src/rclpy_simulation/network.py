"""The simulated network: its delays and losses.

It follows DDS and RTPS as Cyclone DDS implements them, in what a program can notice: a volatile sample that
is sent before the match is lost; a reliable writer sends again, and keeps at most what its history allows;
samples of one writer arrive in order; participants that fall silent are forgotten after their lease.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from rclpy_simulation.host import SECOND, Host
from rclpy_simulation.kernel import Kernel

_Z99 = 2.326  # standard normal distribution: 99 % are below


@dataclass(frozen=True)
class Delay:
    """A random duration [s] with a log-normal distribution."""

    median: float
    p99: float
    _sigma: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        sigma = math.log(self.p99 / self.median) / _Z99 if self.p99 > self.median else 0.0
        object.__setattr__(self, "_sigma", sigma)

    def draw(self, kernel: Kernel) -> int:
        """Return a duration [ns]."""
        if not self._sigma:
            return int(self.median * SECOND)
        return int(self.median * kernel.random.lognormvariate(0.0, self._sigma) * SECOND)


LATENCY = Delay(0.0003, 0.003)
DISCOVERY = Delay(0.03, 0.12)
MATCHING = Delay(0.002, 0.02)
RETRANSMISSION = Delay(0.01, 0.1)


@dataclass
class Network:
    """How the network behaves. All values may change while the simulation runs."""

    latency: Delay = LATENCY
    """From a writer to a reader, with the time until the reader's process is scheduled."""
    discovery: Delay = DISCOVERY
    """From the start of a participant until another one knows it."""
    matching: Delay = MATCHING
    """From the creation or deletion of an endpoint until another participant knows of it."""
    loss: float = 0.0
    """Part of the packets between processes that is lost, from 0 up to, but not including, 1."""
    retransmission: Delay = RETRANSMISSION
    """By which a lost sample of a reliable writer is late."""
    lease: float = 10.0
    """Time after which a silent participant is forgotten [s]."""
    announcement: float = 8.0
    """Period at which a participant announces itself, so forgotten ones meet again [s]."""
    held: dict[str, int] = field(default_factory=dict)
    """DDS topics whose samples wait, with the time until when [ns]."""
    lost: dict[str, int] = field(default_factory=dict)
    """DDS topics whose samples are lost, with the time until when [ns]."""
    cuts: dict[frozenset[str], int] = field(default_factory=dict)
    """Pairs of hosts between which no packet passes, with the time since when [ns]."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "loss" and not 0.0 <= value < 1.0:  # with 1, a reliable writer would send again for ever
            raise ValueError(f"{value} is no part of the packets: from 0 up to, but not including, 1")
        super().__setattr__(name, value)

    def is_cut(self, one: Host, other: Host) -> bool:
        """Return whether a partition separates two hosts."""
        return frozenset((one.name, other.name)) in self.cuts
