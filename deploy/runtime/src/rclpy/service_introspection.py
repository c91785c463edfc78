"""How much of its calls a service or client tells on ``<service>/_service_event``."""

from __future__ import annotations

from enum import IntEnum


class ServiceIntrospectionState(IntEnum):
    """What others can see of each call."""

    OFF = 0
    """Nothing."""
    METADATA = 1
    """When which client's call reached which stage."""
    CONTENTS = 2
    """Requests and responses, too."""
