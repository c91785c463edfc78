"""MCAP files of ROS 2 messages that survive the sudden death of their writer, and what reads them.

It stands on the library ``mcap`` alone, so any rclpy may run beside it.
"""

from mcap_files.reader import McapFile, UnreadableError
from mcap_files.writer import SAVE_PERIOD, FileWriter

__all__ = ["FileWriter", "McapFile", "SAVE_PERIOD", "UnreadableError"]
