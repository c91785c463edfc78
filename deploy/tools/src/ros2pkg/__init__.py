"""What tools ask about packages, with the names of ROS 2's `ros2pkg`."""
