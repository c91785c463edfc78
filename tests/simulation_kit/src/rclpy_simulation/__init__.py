"""A testing kit: rclpy programs in virtual time, on a simulated network, with faults."""

from importlib.util import find_spec

import rclpy

if find_spec("rclpy._dds") is None:
    raise ImportError(
        f"rclpy_simulation needs the rclpy of rclpy-cyclonedds, not that of {rclpy.__path__[0]}"
    )
if find_spec("greenlet") is None:
    raise ImportError("rclpy_simulation needs greenlet: pip install 'greenlet>=3.1,<4'")

from rclpy_simulation.host import Host
from rclpy_simulation.network import Delay, Network
from rclpy_simulation.process import Process
from rclpy_simulation.simulation import Simulation

__all__ = ["Delay", "Host", "Network", "Process", "Simulation"]
