"""The whole arm for a few seconds: it starts, brings back what is killed, and stops. `make test` runs it."""

from __future__ import annotations

import os
import signal

import pytest

from tests.system.sites import STEADY, Site


@pytest.mark.minute
def test_an_arm_starts_brings_back_a_killed_service_and_stops(site: Site) -> None:
    assert site.do("start", STEADY)[0] == 0
    assert site.members.keys() == {*site.programs, ""}
    killed = site.members["kinematics"]
    os.kill(killed, signal.SIGKILL)
    site.await_members(lambda members: members.get("kinematics", killed) != killed)
    assert site.do("stop")[0] == 0
    assert site.members == {}
