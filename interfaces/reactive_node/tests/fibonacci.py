"""The action of the tests."""

try:
    from example_interfaces.action import Fibonacci
except ModuleNotFoundError:  # ROS 2's wheels
    from test_msgs.action import Fibonacci

__all__ = ["Fibonacci"]
