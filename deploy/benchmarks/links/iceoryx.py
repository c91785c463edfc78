"""iceoryx2: shared memory, and an event that wakes the subscriber."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

import iceoryx2

from deploy.benchmarks.link import Item, Job, Link


class Connection(Link):
    """A node with a service and an event for each topic."""

    def __init__(self, job: Job) -> None:
        super().__init__(job)
        iceoryx2.set_log_level(iceoryx2.LogLevel.Error)
        builder = iceoryx2.NodeBuilder.new()
        builder = builder.signal_handling_mode(iceoryx2.SignalHandlingMode.Disabled)
        self.node = builder.create(iceoryx2.ServiceType.Ipc)
        self.subscriptions: list[tuple[Any, Any, Callable[[Any], object]]] = []

    def publisher(self, topic: str) -> Callable[[Item], object]:
        publisher = self._service(topic).publisher_builder().initial_max_slice_len(self.job.size).create()
        notifier = self._event(topic).notifier_builder().create()
        size = self.job.size

        def publish(item: Any) -> None:
            sample = publisher.loan_slice_uninit(size)
            source = (ctypes.c_uint8 * size).from_buffer(item)
            ctypes.memmove(sample.payload_ptr, source, size)
            sample.assume_init().send()
            notifier.notify()

        return publish

    def subscribe(self, topic: str, on_item: Callable[[Any], object]) -> None:
        subscriber = self._service(topic).subscriber_builder().create()
        listener = self._event(topic).listener_builder().create()
        self.subscriptions.append((listener, subscriber, on_item))

    def _service(self, topic: str) -> Any:
        builder = self.node.service_builder(self._name(topic))
        octets = builder.publish_subscribe(iceoryx2.Slice[ctypes.c_uint8])
        return octets.subscriber_max_buffer_size(self.job.depth).open_or_create()

    def _event(self, topic: str) -> Any:
        return self.node.service_builder(self._name(topic)).event().open_or_create()

    def _name(self, topic: str) -> Any:
        return iceoryx2.ServiceName.new(f"{Path(self.job.directory).name}/{topic}")

    def wait(self, seconds: float) -> None:
        for listener, subscriber, on_item in self.subscriptions:
            listener.timed_wait(iceoryx2.Duration.from_secs_f64(seconds))
            while (sample := subscriber.receive()) is not None:
                on_item(sample.payload().as_memory_view())
                sample.delete()
