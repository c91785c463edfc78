"""The life of a service: turns a recipe into a process."""

from interfaces.service.node import ServiceNode, refuse, run

__all__ = ["ServiceNode", "refuse", "run"]
