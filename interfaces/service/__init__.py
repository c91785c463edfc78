"""The service framework: turns a recipe into a process.

A service declares its parameters (``parameters.py``) and wires its recipe to topics (``node.py``);
``process.py`` runs it until a signal. ``reading.py`` judges each message before the recipe sees it,
``health.py`` reports once a second, ``beats.py`` shows the sentinel that it lives, and ``instance.py`` lets
no second one start. ``clocks.py``, ``peers.py`` and ``enclave.py`` report other hosts, other nodes and keys
that end.
"""

from interfaces.service.errors import UserError
from interfaces.service.node import Rejected, ServiceNode
from interfaces.service.parameters import parameter
from interfaces.service.process import refuse, run

__all__ = ["Rejected", "ServiceNode", "UserError", "parameter", "refuse", "run"]
