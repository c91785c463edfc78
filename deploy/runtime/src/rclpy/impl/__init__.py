"""Modules behind rclpy's public ones, at the places where rclpy has them."""
