"""What tools ask about services, with the names of ROS 2's `ros2service`."""
