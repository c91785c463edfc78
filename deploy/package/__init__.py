"""reactive-arm as a package of a ROS 2 workspace."""
