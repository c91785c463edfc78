"""Interfaces of example_interfaces, as in ROS 2 Jazzy."""
