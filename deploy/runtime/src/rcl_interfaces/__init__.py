"""Interfaces of rcl_interfaces, as in ROS 2 Jazzy."""
