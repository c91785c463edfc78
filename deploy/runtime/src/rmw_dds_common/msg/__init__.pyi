"""Messages of rmw_dds_common. Made by rosidl_runtime_embedded.stubs."""

from collections.abc import Iterable

import numpy
from numpy.typing import NDArray

from rosidl_runtime_embedded import Message

class Gid(Message):
    @property
    def data(self) -> NDArray[numpy.uint8]: ...
    @data.setter
    def data(self, value: Iterable[int]) -> None: ...
    def __init__(
        self,
        *,
        data: Iterable[int] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class NodeEntitiesInfo(Message):
    node_namespace: str
    node_name: str
    reader_gid_seq: list[Gid]
    writer_gid_seq: list[Gid]
    def __init__(
        self,
        *,
        node_namespace: str = ...,
        node_name: str = ...,
        reader_gid_seq: list[Gid] = ...,
        writer_gid_seq: list[Gid] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class ParticipantEntitiesInfo(Message):
    gid: Gid
    node_entities_info_seq: list[NodeEntitiesInfo]
    def __init__(
        self,
        *,
        gid: Gid = ...,
        node_entities_info_seq: list[NodeEntitiesInfo] = ...,
        check_fields: bool = ...,
    ) -> None: ...
