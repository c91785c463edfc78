"""The start of a system: what it waits for, what it reads, and what it reports of a service that fails."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.system.obstacles import another_at_work, writer_to_a_reader_of
from tests.system.sites import STEADY, Site


def test_a_start_waits_for_another_start_or_stop(small_site: Site) -> None:
    with another_at_work(small_site):
        command = small_site.begin("start", STEADY)
        command.await_line("Waiting for another make to end its start or stop")
        assert small_site.members == {}
    command.await_line("It runs in the background")
    assert command.wait() == 0


def test_a_service_that_does_not_start_shows_its_last_words(
    small_site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = "services.engine_controller"
    crash = f"import os, sys\nif {module!r} in sys.orig_argv: print('crash', flush=True); os._exit(1)"
    (tmp_path / "sitecustomize.py").write_text(crash)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)  # ahead of a sourced ROS 2
    logs = small_site.run / "logs"
    logs.mkdir(parents=True)
    (logs / "engine_controller.log").write_text("a line of an earlier start\n")
    code, printed = small_site.do("start", STEADY)
    assert code == 1
    lines = printed.splitlines()
    assert lines[lines.index("engine_controller does not start:") + 1 :] == ["crash"]
    assert small_site.members == {}


def test_the_scenario_begins_when_all_services_are_up(
    site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = "import sys, time\nif 'services.dead_mans_switch' in sys.orig_argv: time.sleep(6.0)"
    (tmp_path / "sitecustomize.py").write_text(slow)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)  # ahead of a sourced ROS 2
    scenario = tmp_path / "early.yaml"
    scenario.write_text("operator: {pressed: [{from: 0.0}]}\nengines: [{at: 1.0, command: turn_on}]")
    command = site.begin("run", str(scenario))
    command.await_line("All services are up")
    time = command.await_line(r"^\[(\d+)\] Engines are on")[1]
    assert 1000 <= int(time) < 4000


def test_a_parameter_file_may_be_a_pipe(small_site: Site, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    os.mkfifo(file)
    command = small_site.begin("run", STEADY, str(file))
    with writer_to_a_reader_of(file, command) as writer:
        os.write(writer, b"dead_mans_switch: {ros__parameters: {pressed: true}}")
    command.await_line("Received signal from operator")
