"""The content of the events that services and clients publish on ``<service>/_service_event``."""

from __future__ import annotations

from enum import IntEnum


class ServiceIntrospectionState(IntEnum):
    """The content of the event of each call."""

    OFF = 0
    """No event is published."""
    METADATA = 1
    """Stage and time of the call, and its client."""
    CONTENTS = 2
    """Also the request or response."""
