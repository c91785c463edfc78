"""What tools ask about nodes, with the names of ROS 2's `ros2node`."""
