"""Callback groups that forget entities that have gone: rclpy's keep a weak reference to each, 80 octets."""

from __future__ import annotations

import weakref
from typing import Any

from rclpy.callback_groups import CallbackGroup


class _Present(set[Any]):
    """Weak references, without those to what has gone."""

    def add(self, reference: weakref.ref[Any]) -> None:
        super().add(weakref.ref(reference(), self.discard))


def forget_the_gone(group: CallbackGroup) -> None:
    """Make a group forget each entity that joins it from now on when that has gone."""
    group.entities = _Present(group.entities)
