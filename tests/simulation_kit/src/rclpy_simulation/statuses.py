"""The communication statuses of simulated writers and readers (DDS 1.4, 2.2.4.1)."""

from __future__ import annotations

from rclpy_simulation.conditions import Condition

_COUNTS = ("total_count", "total_count_change")
_HANDLE = "last_instance_handle"
_MATCHED = (*_COUNTS, "current_count", "current_count_change", _HANDLE)

_FIELDS: dict[str, tuple[str, ...]] = {
    "offered_deadline_missed": (*_COUNTS, _HANDLE),
    "requested_deadline_missed": (*_COUNTS, _HANDLE),
    "offered_incompatible_qos": (*_COUNTS, "last_policy_id"),
    "requested_incompatible_qos": (*_COUNTS, "last_policy_id"),
    "liveliness_lost": _COUNTS,
    "liveliness_changed": (
        "alive_count",
        "not_alive_count",
        "alive_count_change",
        "not_alive_count_change",
        _HANDLE,
    ),
    "publication_matched": _MATCHED,
    "subscription_matched": _MATCHED,
}
"""The fields of each status that occurs. Cyclone DDS never reports ``sample_lost`` to a ROS subscription: it
does so only for samples that a reader rejects because of another order of destination or ownership."""


class Statuses:
    def __init__(self) -> None:
        self.handle = Condition()
        self._values: dict[str, dict[str, int]] = {}
        self._changed: dict[str, None] = {}
        self._watched: set[str] = set()

    def watch(self, names: list[str]) -> None:
        """Trigger the condition for these statuses, and for no others."""
        self._watched = set(names)
        self._update()

    def watch_also(self, name: str) -> None:
        self._watched.add(name)
        self._update()

    def change(self, name: str, **changes: int) -> None:
        """Add to counts and their changes; fields that begin with ``last_`` are set."""
        values = self._values.setdefault(name, dict.fromkeys(_FIELDS[name], 0))
        for field, change in changes.items():
            if field.startswith("last_"):
                values[field] = change
            else:
                values[field] += change
                values[f"{field}_change"] += change
        self._changed[name] = None
        self._update()

    def changed(self, name: str) -> dict[str, int] | None:
        if name not in self._changed:
            return None
        del self._changed[name]
        self._update()
        values = self._values[name]
        found = dict(values)
        for field in values:
            if field.endswith("_change"):
                values[field] = 0
        return found

    def _update(self) -> None:
        if self._watched & self._changed.keys():
            self.handle.set()
        else:
            self.handle.clear()
