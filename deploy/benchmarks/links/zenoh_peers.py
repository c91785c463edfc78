"""eclipse-zenoh: peers that find each other through the sink, without multicast."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import zenoh

from deploy.benchmarks.link import SINK, Item, Job, Link


class Connection(Link):
    """A session; its callbacks run on a thread of zenoh."""

    def __init__(self, job: Job) -> None:
        super().__init__(job)
        config = zenoh.Config()
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("listen/endpoints", json.dumps([self._address(job.role)]))
        if job.role != SINK:
            config.insert_json5("connect/endpoints", json.dumps([self._address(SINK)]))
        self.session = zenoh.open(config)

    def _address(self, role: str) -> str:
        return f"unixsock-stream/{self.job.directory}/{role}"

    def publisher(self, topic: str) -> Callable[[Item], object]:
        block = zenoh.CongestionControl.BLOCK
        publisher = self.session.declare_publisher(topic, congestion_control=block)
        return lambda item: publisher.put(bytes(item))

    def subscribe(self, topic: str, on_item: Callable[[Any], object]) -> None:
        self.session.declare_subscriber(topic, lambda sample: on_item(sample.payload.to_bytes()))

    def wait(self, seconds: float) -> None:
        time.sleep(seconds)

    def close(self) -> None:
        self.session.close()
