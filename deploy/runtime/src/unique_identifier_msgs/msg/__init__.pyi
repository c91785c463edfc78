"""Messages of unique_identifier_msgs. Made by rosidl_runtime_embedded.stubs."""

from collections.abc import Iterable

import numpy
from numpy.typing import NDArray

from rosidl_runtime_embedded import Message

class UUID(Message):
    @property
    def uuid(self) -> NDArray[numpy.uint8]: ...
    @uuid.setter
    def uuid(self, value: Iterable[int]) -> None: ...
    def __init__(
        self,
        *,
        uuid: Iterable[int] = ...,
        check_fields: bool = ...,
    ) -> None: ...
