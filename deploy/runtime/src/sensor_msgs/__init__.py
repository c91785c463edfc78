"""Interfaces of sensor_msgs, as in ROS 2 Jazzy."""
