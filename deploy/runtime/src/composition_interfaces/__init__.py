"""Interfaces of composition_interfaces, as in ROS 2 Jazzy."""
