"""The service framework: turns a recipe into a process."""

from interfaces.service.errors import UserError
from interfaces.service.node import Rejected, ServiceNode
from interfaces.service.parameters import parameter
from interfaces.service.process import refuse, run

__all__ = ["Rejected", "ServiceNode", "UserError", "parameter", "refuse", "run"]
