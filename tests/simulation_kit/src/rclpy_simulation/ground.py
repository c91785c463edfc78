"""The ground of virtual time: what rclpy stands on in an interpreter that simulates."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy_simulation.conditions import GuardCondition, WaitSet
from rclpy_simulation.process import here

if TYPE_CHECKING:  # it imports rclpy, which needs a ground
    from rclpy_simulation.participant import Domains, Participant


class VirtualTime:
    """Participants join the domains of the simulation that runs."""

    name = "rmw_simulation"
    has_processes = True

    def __init__(self) -> None:
        self.domains: Domains | None = None
        """Those of the simulation that runs."""

    def check(self, domain_id: int, enclave: str) -> None:
        """Do nothing: a simulation has all domains, and no keys."""

    def create_participant(self, domain_id: int, enclave: str) -> Participant:
        if self.domains is None:
            raise RuntimeError("no simulation runs: nodes live in programs that Simulation.start starts")
        return self.domains.create_participant(domain_id, enclave)

    def create_guard_condition(self) -> GuardCondition:
        return GuardCondition()

    def create_wait_set(self) -> WaitSet:
        return WaitSet()

    def watch_signals(self) -> None:
        """Do nothing: a simulated signal ends the wait of its process."""

    def note_poll(self) -> None:
        if here.thread is not None:
            here.thread.note_empty_wait()


GROUND = VirtualTime()
