"""Interfaces of rmw_dds_common, as in ROS 2 Jazzy."""
