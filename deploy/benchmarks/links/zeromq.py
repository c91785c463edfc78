"""pyzmq: PUB and SUB over Unix sockets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import zmq

from deploy.benchmarks.link import Item, Job, Link

_RECONNECT = 10  # ms between two attempts of a subscriber that starts before its publisher


class Connection(Link):
    """A socket for each topic."""

    def __init__(self, job: Job) -> None:
        super().__init__(job)
        self.context = zmq.Context()
        self.poller = zmq.Poller()
        self.callbacks: dict[Any, Callable[[Any], object]] = {}

    def publisher(self, topic: str) -> Callable[[Item], object]:
        socket = self.context.socket(zmq.PUB)
        socket.set_hwm(self.job.depth)
        socket.bind(self._address(topic))
        return socket.send  # type: ignore[no-any-return]

    def subscribe(self, topic: str, on_item: Callable[[Any], object]) -> None:
        socket = self.context.socket(zmq.SUB)
        socket.set_hwm(self.job.depth)
        socket.set(zmq.RECONNECT_IVL, _RECONNECT)
        socket.subscribe(b"")
        socket.connect(self._address(topic))
        self.poller.register(socket, zmq.POLLIN)
        self.callbacks[socket] = on_item

    def _address(self, topic: str) -> str:
        return f"ipc://{self.job.directory}/{topic}"

    def wait(self, seconds: float) -> None:
        for socket, _ in self.poller.poll(1000 * seconds):
            self.callbacks[socket](socket.recv())

    def close(self) -> None:
        self.context.destroy(linger=0)
