"""Events of QoS: deadlines, liveliness, incompatible policies, lost messages, matched endpoints."""

from __future__ import annotations

from typing import Any

from rclpy_ground.genuine import genuine
from rclpy_ground.handles import Destroyable
from rclpy_ground.topics import WithEvents

_POLICIES = {2: 2, 4: 4, 8: 8, 11: 16, 13: 32, 10: 64}
"""rmw_qos_policy_kind_t by the identifier of a policy of DDS (DDS 1.4, 2.3.3)."""
_INVALID_POLICY = 1


class _Status:
    """The fields of a status, as rmw names them."""

    def __init__(self, fields: dict[str, int]) -> None:
        found: dict[str, Any] = dict(fields)
        if (policy := found.pop("last_policy_id", None)) is not None:
            kind = _POLICIES.get(policy, _INVALID_POLICY)
            found["last_policy_kind"] = genuine.rmw_qos_policy_kind_t(kind)
        found.pop("last_instance_handle", None)
        self.__dict__.update(found)


class rmw_requested_deadline_missed_status_t(_Status):
    pass


class rmw_liveliness_changed_status_t(_Status):
    pass


class rmw_message_lost_status_t(_Status):
    pass


class rmw_requested_qos_incompatible_event_status_t(_Status):
    pass


class rmw_matched_status_t(_Status):
    pass


class rmw_offered_deadline_missed_status_t(_Status):
    pass


class rmw_liveliness_lost_status_t(_Status):
    pass


class rmw_incompatible_type_status_t(_Status):
    pass


_EVENTS: dict[str, tuple[str, type[_Status]]] = {
    "RCL_SUBSCRIPTION_REQUESTED_DEADLINE_MISSED": (
        "requested_deadline_missed",
        rmw_requested_deadline_missed_status_t,
    ),
    "RCL_SUBSCRIPTION_LIVELINESS_CHANGED": ("liveliness_changed", rmw_liveliness_changed_status_t),
    "RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS": (
        "requested_incompatible_qos",
        rmw_requested_qos_incompatible_event_status_t,
    ),
    "RCL_SUBSCRIPTION_MESSAGE_LOST": ("sample_lost", rmw_message_lost_status_t),
    "RCL_SUBSCRIPTION_MATCHED": ("subscription_matched", rmw_matched_status_t),
    "RCL_PUBLISHER_OFFERED_DEADLINE_MISSED": (
        "offered_deadline_missed",
        rmw_offered_deadline_missed_status_t,
    ),
    "RCL_PUBLISHER_LIVELINESS_LOST": ("liveliness_lost", rmw_liveliness_lost_status_t),
    # rclpy has one class for both sides.
    "RCL_PUBLISHER_OFFERED_INCOMPATIBLE_QOS": (
        "offered_incompatible_qos",
        rmw_requested_qos_incompatible_event_status_t,
    ),
    "RCL_PUBLISHER_MATCHED": ("publication_matched", rmw_matched_status_t),
}
"""The status of DDS, and the class of its values, by the name of an event of rcl."""
_COUNTS = dict.fromkeys(("total_count", "total_count_change"), 0)
_MATCHED = _COUNTS | dict.fromkeys(("current_count", "current_count_change"), 0)
_ALIVE = dict.fromkeys(("alive_count", "not_alive_count", "alive_count_change", "not_alive_count_change"), 0)


def _zeros(status: str) -> dict[str, int]:
    if status == "liveliness_changed":
        return _ALIVE
    if status.endswith("_matched"):
        return _MATCHED
    return _COUNTS | {"last_policy_id": 0} if status.endswith("_qos") else _COUNTS


class EventHandle(Destroyable):
    """An event of a publisher or subscription."""

    def __init__(self, parent: WithEvents, event_type: Any) -> None:
        if event_type.name not in _EVENTS:
            raise genuine.UnsupportedEventTypeError("this event is unsupported")
        super().__init__()
        self._status, self._type = _EVENTS[event_type.name]
        self._endpoint = parent.endpoint
        self._found: dict[str, int] | None = None
        self._unchanged = self._type(_zeros(self._status))
        self.condition = parent.endpoint.handle
        self._endpoint.watch_also(self._status)

    def look(self) -> bool:
        """Return whether its status has changed."""
        if self._found is None:
            self._found = self._endpoint.changed(self._status)
        return self._found is not None

    def take_event(self) -> Any:
        """Return the status, even if nothing has changed: as rmw does."""
        if not self.look():
            return self._unchanged
        found, self._found = self._found or {}, None
        unchanged = {name: 0 if name.endswith("_change") else value for name, value in found.items()}
        self._unchanged = self._type(unchanged)
        return self._type(found)
