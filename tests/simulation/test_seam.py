from __future__ import annotations

import os

import pytest
from rclpy_simulation import Network, Simulation

from deploy.supervision import processes
from interfaces import loopback, seam
from tests.simulation.machine import Machine


def test_a_simulation_replaces_every_replaceable_function() -> None:
    with Simulation("seam", Network()) as simulation:
        answered = Machine(simulation, tuple).answers()
    assert {*answered} == {*seam.replaceable_functions}


def test_functions_are_replaced_until_the_end() -> None:
    with seam.replaced({processes.stat_of: lambda pid: [str(pid)]}):
        assert processes.stat_of(7) == ["7"]
    assert processes.stat_of(os.getpid())[1] == str(os.getppid())


def test_an_error_ends_the_replacement() -> None:
    with pytest.raises(ZeroDivisionError), seam.replaced({loopback.loopback_is_up: lambda: 1 // 0}):
        loopback.loopback_is_up()
    assert loopback.loopback_is_up() in (True, False)
