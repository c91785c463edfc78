"""Internal modules, with the same paths as in rclpy."""
