"""Interfaces of type_description_interfaces, as in ROS 2 Jazzy."""
