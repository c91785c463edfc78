"""Asks a node to set parameters, and lies about their number: `python -m tests.dds_liar DOMAIN NODE SIZE`

The request has SIZE octets. The program ends when the middleware of the node has it. The annotations are not
postponed: cyclonedds evaluates them.
"""

import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import sequence, uint8
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
from cyclonedds.util import duration

import tests.dds_stranger  # noqa: F401  # its settings of Cyclone DDS

LIMIT = 10.0  # s


@dataclass
class Request(IdlStruct, typename="rcl_interfaces::srv::dds_::SetParameters_Request_"):
    parameters: sequence[uint8]  # on the wire, as many parameters as it has octets


def main(domain: int, node: str, size: int) -> None:
    participant = DomainParticipant(domain)
    qos = Qos(Policy.Reliability.Reliable(duration(seconds=LIMIT)))
    writer = DataWriter(participant, Topic(participant, f"rq/{node}/set_parametersRequest", Request), qos)
    end = time.monotonic() + LIMIT
    while not writer.get_matched_subscriptions():
        assert time.monotonic() < end, f"{node} is not there"
        time.sleep(0.01)
    writer.write(Request([0] * size))
    assert writer.wait_for_acks(duration(seconds=LIMIT))


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
