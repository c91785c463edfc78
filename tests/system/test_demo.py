"""The demo, as an operator runs it who has the services that watch the operator."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path

from tests.system.sites import SMALL, Site, make_small_arm


def test_releasing_the_switch_in_the_demo_stops_the_engines(tmp_path: Path, domain_id: int) -> None:
    arm = make_small_arm(tmp_path, (*SMALL, "operator_watchdog"))
    with closing(Site(tmp_path / "run", domain_id, directory=arm)) as site:
        command = site.begin("run", "demo")
        command.await_line("Engines are on")
        released = time.monotonic()
        command.type("release\n")
        command.await_line(r"Turning off engines\.\.\.$")
        turned_off = next(time_ for time_, text in command.lines if "Turning off engines" in text)
        assert turned_off - released < 10.5
        command.type("quit\n")
        assert command.wait() == 0
