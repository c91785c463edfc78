"""What tools ask about topics, with the names of ROS 2's `ros2topic`."""
