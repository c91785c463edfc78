"""Interfaces of action_msgs, as in ROS 2 Jazzy."""
