"""Interfaces of builtin_interfaces, as in ROS 2 Jazzy."""
