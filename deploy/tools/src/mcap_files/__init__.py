"""MCAP files of ROS 2 messages that survive the sudden death of their writer, and what reads them.

It works with any rclpy.
"""

from mcap_files.reader import McapFile, UnreadableError
from mcap_files.writer import SAVE_PERIOD, FileWriter

__all__ = ["FileWriter", "McapFile", "SAVE_PERIOD", "UnreadableError"]
