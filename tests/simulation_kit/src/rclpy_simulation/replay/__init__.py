"""Recorded messages in, those of your programs out: what ``python -m rclpy_simulation replay`` does."""
