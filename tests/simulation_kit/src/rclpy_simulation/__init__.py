"""rclpy programs in virtual time, on a simulated network: :class:`Simulation` says how."""

import threading
from _threading_local import local
from importlib.util import find_spec

if find_spec("greenlet") is None:
    raise ImportError("rclpy_simulation needs greenlet: pip install 'greenlet>=3.1,<4'")

# Before a library derives from it: in the one in C, all simulated threads share the values of the real one.
threading.local = local  # type: ignore[assignment]

import rclpy_ground  # noqa: E402
from rclpy_simulation.ground import GROUND  # noqa: E402

rclpy_ground.install(GROUND)  # before rclpy is imported, as the modules below do

from rclpy_simulation.faults import Fault  # noqa: E402
from rclpy_simulation.host import Host  # noqa: E402
from rclpy_simulation.network import Delay, Network  # noqa: E402
from rclpy_simulation.process import Process  # noqa: E402
from rclpy_simulation.simulation import Simulation  # noqa: E402

__all__ = ["Delay", "Fault", "Host", "Network", "Process", "Simulation"]
