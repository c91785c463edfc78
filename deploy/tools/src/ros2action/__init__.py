"""What tools ask about actions, with the names of ROS 2's `ros2action`."""
