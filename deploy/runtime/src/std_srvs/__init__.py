"""Interfaces of std_srvs, as in ROS 2 Jazzy."""
