"""The part of ROS 2's interface parser that message classes refer to: their types."""
