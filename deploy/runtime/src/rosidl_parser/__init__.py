"""The part of ROS 2's interface parser that message classes use: the types of fields."""
