"""The kit's own plugin. A user's project names it in ``pytest_plugins``."""

from rclpy_simulation.testing import pytest_configure, pytest_runtest_makereport, simulation

__all__ = ["pytest_configure", "pytest_runtest_makereport", "simulation"]
