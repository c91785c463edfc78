"""What tools ask about interfaces, with the names of ROS 2's `ros2interface`."""
