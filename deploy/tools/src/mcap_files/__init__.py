"""MCAP files of ROS 2 messages that survive the sudden death of their writer, and what reads them.

It needs only the library ``mcap``, so it works with any rclpy.
"""

from mcap_files.reader import McapFile, UnreadableError, is_cut
from mcap_files.writer import SAVE_PERIOD, FileWriter

__all__ = ["FileWriter", "McapFile", "SAVE_PERIOD", "UnreadableError", "is_cut"]
