"""The life of a service: turns a recipe into a process."""

from interfaces.service.node import ServiceNode, refuse, run
from interfaces.service.parameters import parameter

__all__ = ["ServiceNode", "parameter", "refuse", "run"]
