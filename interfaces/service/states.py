"""Topics of states as signals: values between the messages (:mod:`reactive_node.signals`).

While the publisher of a state lives, silence means that nothing changes. While it is dead, the last value is
held, and marked so.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import reactivex as rx
from reactivex import Observable

from interfaces.service.node import ServiceNode
from interfaces.topics import Topic
from reactive_node import Timestamp
from reactive_node.ros_time import in_ros_time
from reactive_node.sampled_reader import keep_last
from reactive_node.signals import Refused, Signal, Unchanged, hold, linear
from reactive_node.stamps import stamped

LATENESS = 0.05  # s that a message may take
GAP = 0.1
"""The longest time [s] between two samples of a movement: configuration publishers send 25 in a second."""
DEPTH = 100
"""
Samples that may wait while the process is not scheduled: those of 4 s. DDS does not report one that is lost,
and a replay would still have it.
"""
LIFE_PERIOD = 0.5  # s between two looks for the publishers


def observe_state(node: ServiceNode, topic: Topic, gap: float = GAP) -> Signal[float]:
    """Return the value of a topic at every time; samples that are too late are reported.

    :param gap: the longest time between two samples of a movement [s].
    """
    ros_time = in_ros_time(node.scheduler)
    every = replace(topic, qos=keep_last(topic.qos, DEPTH))

    def refused(sample: Refused) -> None:
        if not sample.is_first:  # a late reader gets the last value, however old it is
            node.health.refuse(topic.name, sample.reason, sample.time, sample.taken)

    lives = rx.timer(0.0, LIFE_PERIOD).map(lambda _: node.count_publishers(topic.name) > 0)
    return state(
        node.observe(every, timestamped=True).map(_not_ahead).pipe(ros_time),
        lives.map(lambda it: stamped(it, time.time_ns())).pipe(ros_time),
        gap,
        refused,
    )


def _not_ahead(sample: Timestamp[float]) -> Timestamp[float]:
    """Return a sample that counts from now on at the latest: the time of day may have been set back."""
    now = stamped(sample.value, time.time_ns())
    return min(sample, now, key=lambda it: it.timestamp)


def state(
    samples: Observable[Timestamp[float]],
    alive: Observable[Timestamp[bool]],
    gap: float = GAP,
    refused: Callable[[Refused], None] | None = None,
) -> Signal[float]:
    """Return the value of a state, certain only while its publisher lives.

    :param alive: whether there is a publisher.
    :param gap: see :func:`observe_state`.
    :param refused: called with each sample that is too late.
    """
    values = linear(samples, lateness=LATENESS, gap=gap, silence=Unchanged(), refused=refused)
    return values.certain_while(hold(alive, lateness=LATENESS))
