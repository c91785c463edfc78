"""The ground of Cyclone DDS: the C library of PyPI's ``cyclonedds``, or one with DDS Security."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # they import rclpy, which needs a ground
    from rclpy_ground.interface import GuardCondition, Participant, WaitSet


class CycloneDDS:
    """Participants join the domains of DDS."""

    name = "rmw_cyclonedds_cpp"
    has_processes = False

    def check(self, domain_id: int, enclave: str) -> None:
        from . import domain, security

        domain.configuration(domain_id=domain_id)  # now, not with the first node
        security.properties(enclave, os.environ)

    def create_participant(self, domain_id: int, enclave: str) -> Participant:
        from .participant import Participant

        return Participant(domain_id, enclave)

    def create_guard_condition(self) -> GuardCondition:
        from .entities import GuardCondition

        return GuardCondition()

    def create_wait_set(self) -> WaitSet:
        from .entities import WaitSet

        self.watch_signals()
        return WaitSet()

    def watch_signals(self) -> None:
        from .wakeup import listen

        listen()

    def note_poll(self) -> None:
        """Do nothing: time passes by itself."""
