"""Helpers for the messages of sensor_msgs, with the API of common_interfaces' sensor_msgs_py."""
