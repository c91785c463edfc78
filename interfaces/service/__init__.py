"""The life of a service: turns a recipe into a process."""

from interfaces.service.errors import UserError
from interfaces.service.node import ServiceNode, refuse, run
from interfaces.service.parameters import parameter

__all__ = ["ServiceNode", "UserError", "parameter", "refuse", "run"]
