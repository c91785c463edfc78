"""What tools ask about parameters, with the names of ROS 2's `ros2param`."""
