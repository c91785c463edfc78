"""A participant of plain DDS whose node has any name: `python dds_stranger.py DOMAIN NAME TOPIC...`

NAME is in hexadecimal digits. It publishes std_msgs/Int32 on the topics, until its standard input ends. No
rclpy takes such a name. The annotations are not postponed: cyclonedds evaluates them.
"""

import os
import sys
from dataclasses import dataclass

os.environ["CYCLONEDDS_URI"] = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces>'
    "<AllowMulticast>spdp</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    '<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer Address="127.0.0.1"/></Peers>'
    "</Discovery></Domain></CycloneDDS>"
)

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, int32, sequence, uint8
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    data: array[uint8, 16]


@dataclass
class Node(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    namespace: sequence[uint8]  # on the wire, a string is the sequence of its octets
    name: sequence[uint8]
    readers: sequence[Gid]
    writers: sequence[Gid]


@dataclass
class Participant(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
    gid: Gid
    nodes: sequence[Node]


@dataclass
class Int32(IdlStruct, typename="std_msgs::msg::dds_::Int32_"):
    data: int32


def gid(entity: DomainParticipant | DataWriter) -> Gid:
    return Gid(list(entity.guid.bytes))


def main(domain: int, name: bytes, topics: list[str]) -> None:
    participant = DomainParticipant(domain)
    reliable = Policy.Reliability.Reliable(duration(seconds=1))
    writers = [
        DataWriter(participant, Topic(participant, f"rt{topic}", Int32), Qos(reliable)) for topic in topics
    ]
    latched = Qos(reliable, Policy.Durability.TransientLocal, Policy.History.KeepLast(1))
    info = DataWriter(participant, Topic(participant, "ros_discovery_info", Participant), latched)
    node = Node(list(b"/\0"), [*name, 0], [], [gid(writer) for writer in writers])
    info.write(Participant(gid(participant), [node]))
    sys.stdin.read()


if __name__ == "__main__":
    main(int(sys.argv[1]), bytes.fromhex(sys.argv[2]), sys.argv[3:])
