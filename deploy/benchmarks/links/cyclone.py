"""cyclonedds-python: Eclipse Cyclone DDS with its own Python binding."""

# Annotations stay types here: the binding does not resolve strings.
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cyclonedds.core import InstanceState, Policy, Qos, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import sequence, uint8
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from deploy.benchmarks.link import Item, Job, Link

_LOOPBACK = Path(__file__).with_name("loopback.xml")


@dataclass
class Octets(IdlStruct):
    """The type of the topics."""

    data: sequence[uint8]  # type: ignore[type-arg]


class Connection(Link):
    """A participant with writers and readers."""

    def __init__(self, job: Job) -> None:
        super().__init__(job)
        number = int(os.environ["ROS_DOMAIN_ID"])
        self.domain = Domain(number, _LOOPBACK.read_text())
        self.participant = DomainParticipant(number)
        self.qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(job.depth))
        self.arrivals = WaitSet(self.participant)
        self.readers: list[tuple[DataReader[Octets], Callable[[Any], object]]] = []

    def publisher(self, topic: str) -> Callable[[Item], object]:
        writer = DataWriter(self.participant, Topic(self.participant, topic, Octets), self.qos)
        return lambda item: writer.write(Octets(item))  # type: ignore[arg-type]

    def subscribe(self, topic: str, on_item: Callable[[Any], object]) -> None:
        reader = DataReader(self.participant, Topic(self.participant, topic, Octets), self.qos)
        state = ViewState.Any | InstanceState.Any | SampleState.Any
        self.arrivals.attach(ReadCondition(reader, state))
        self.readers.append((reader, on_item))

    def wait(self, seconds: float) -> None:
        self.arrivals.wait(duration(seconds=seconds))
        for reader, on_item in self.readers:
            for sample in reader.take(N=self.job.depth):
                on_item(sample.data)
