"""Images through the node of :mod:`.callbacks`."""

from __future__ import annotations

from sensor_msgs.msg import Image

from tests.benchmarks.links import callbacks


class Connection(callbacks.Connection):
    """Publishes images, with the octets of an item as their pixels."""

    message_type = Image
