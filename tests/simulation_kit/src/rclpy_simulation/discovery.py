"""What a simulated participant has discovered."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from rclpy_ground.interface import Endpoint as EndpointInfo
from rclpy_simulation.conditions import Condition
from rclpy_simulation.endpoints import Endpoint, Reader, Writer


class Discovery:
    def __init__(
        self, participants: Callable[[], dict[bytes, str]], endpoints: Callable[[], Iterable[Endpoint]]
    ) -> None:
        """Create what shows the entities.

        :param participants: returns the GUID and USER_DATA of every known participant.
        :param endpoints: returns every known endpoint.
        """
        self.participants = participants
        self._endpoints = endpoints
        self._news = Condition()
        self._news.set()
        self._writers: list[EndpointInfo] | None = None
        self._readers: list[EndpointInfo] = []

    def note(self) -> None:
        self._writers = None
        self._news.set()

    @property
    def news(self) -> list[Condition]:
        """The conditions that are true while there are unread changes."""
        return [self._news]

    @property
    def gone(self) -> list[Condition]:
        """No conditions: entities that are gone are forgotten at once."""
        return []

    def forget_gone(self) -> None:
        """Do nothing."""

    def refresh(self) -> None:
        """Read all changes: only later ones trigger the condition."""
        self._news.clear()

    def writers(self) -> list[EndpointInfo]:
        return self._all()[0]

    def readers(self) -> list[EndpointInfo]:
        return self._all()[1]

    def _all(self) -> tuple[list[EndpointInfo], list[EndpointInfo]]:
        if self._writers is None:
            everyone = list(self._endpoints())
            self._writers = [each.info for each in everyone if isinstance(each, Writer)]
            self._readers = [each.info for each in everyone if isinstance(each, Reader)]
        return self._writers, self._readers
