"""Images through the node of :mod:`.reactive`."""

from __future__ import annotations

from sensor_msgs.msg import Image

from tests.benchmarks.links import reactive


class Connection(reactive.Connection):
    """Publishes images, with the octets of an item as their pixels."""

    message_type = Image
