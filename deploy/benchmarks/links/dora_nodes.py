"""dora-rs: nodes of a dataflow, which `dora run` starts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pyarrow
from dora import Node

from deploy.benchmarks.link import Item, Job, Link


class Connection(Link):
    """A node; its inputs and outputs are the topics."""

    def __init__(self, job: Job) -> None:
        super().__init__(job)
        self.node = Node()
        self.callbacks: dict[str, Callable[[Any], object]] = {}

    def publisher(self, topic: str) -> Callable[[Item], object]:
        octets = pyarrow.uint8()

        def publish(item: Any) -> None:
            buffer = pyarrow.py_buffer(item)
            self.node.send_output(topic, pyarrow.Array.from_buffers(octets, buffer.size, [None, buffer]))

        return publish

    def subscribe(self, topic: str, on_item: Callable[[Any], object]) -> None:
        self.callbacks[topic] = on_item

    def wait(self, seconds: float) -> None:
        event = self.node.next(timeout=seconds)
        if event is not None and event["type"] == "INPUT":
            value = event["value"]
            octets = memoryview(value.buffers()[1])
            self.callbacks[event["id"]](octets[value.offset : value.offset + len(value)])
