"""The player: a simulated program that publishes recorded messages at their times."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import rclpy
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions

from rclpy_simulation.endpoints import Endpoint, Writer
from rclpy_simulation.host import SECOND
from rclpy_simulation.network import Delay, Network
from rclpy_simulation.process import Process, running
from rclpy_simulation.simulation import Simulation


def constant_network() -> Network:
    """Return a network as on an idle machine, without chance."""
    return Network(latency=Delay(0.0002, 0.0002), discovery=Delay(0.01, 0.01), matching=Delay(0.002, 0.002))


AT_ONCE = Delay(0.0, 0.0)
CLOCK = "/clock"
_SKIPPED = SECOND // 100  # ns for which it does not wait if nobody needs the message


class Offer(NamedTuple):
    """How a topic is published."""

    type: Any
    qos: QoSProfile


class Player:
    """Publishes messages on topics that no other program publishes."""

    def __init__(
        self,
        simulation: Simulation,
        offers: Mapping[str, Offer],
        messages: Callable[[], Iterable[tuple[int, str, bytes]]],
        forced: frozenset[str] = frozenset(),
        host: str = "recorded",
    ) -> None:
        """Start the program now.

        :param messages: yields what is published: times of the monotonic clock [ns], topics and CDR.
        :param forced: topics that are also published if other programs publish them.
        """
        self.yielded: dict[str, int] = {}
        """Topics that other programs publish, and since when [ns]."""
        self.publishers: dict[str, Publisher] = {}
        """By topic."""
        self.error: BaseException | None = None
        """Why the messages ended too early."""
        self._simulation = simulation
        self._offers = dict(offers)
        self._messages = messages
        self._forced = forced
        self._version = -1
        self.process: Process = simulation.start(self._run, name="player", host=host, delay=AT_ONCE)

    def endpoints(self) -> Iterator[Endpoint]:
        """Yield the endpoints of the other programs."""
        for participant in self._simulation.domains.participants:
            if participant.process is not self.process:
                yield from participant.endpoints.values()

    def _run(self) -> None:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("player", enable_rosout=False, start_parameter_services=False)
        thread, domains = running(), self._simulation.domains
        kernel = thread.process.kernel
        self._update()
        try:
            for time, topic, data in self._messages():
                if topic not in self.publishers and time - kernel.now < _SKIPPED:
                    continue
                while kernel.now < time:
                    thread.wait(time)
                if domains.version != self._version:
                    self._update()
                if publisher := self.publishers.get(topic):
                    publisher.publish(data)
        except Exception as error:
            self.error = error
            raise
        while True:  # latched messages live as long as it does
            thread.wait(None)

    def _update(self) -> None:
        """Offer what no other program publishes."""
        self._version = self._simulation.domains.version
        made, heard = set(), set()
        for each in self.endpoints():
            (made if isinstance(each, Writer) else heard).add(each.topic.removeprefix("rt"))
        for topic in sorted(made & self._offers.keys() - self._forced):
            self.yielded[topic] = self._node.get_clock().now().nanoseconds
            del self._offers[topic]
            if publisher := self.publishers.pop(topic, None):
                self._node.destroy_publisher(publisher)
        for topic in sorted(self._offers.keys() - self.publishers.keys()):
            if topic == CLOCK and topic not in heard:
                continue
            message_type, qos = self._offers[topic]
            self.publishers[topic] = self._node.create_publisher(message_type, topic, qos)
