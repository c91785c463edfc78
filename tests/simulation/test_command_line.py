from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from deploy.supervision.processes import ROOT
from tests.chaos.schedule import PlannedFault
from tests.chaos.schedule_file import Experiment, load, save
from tests.chaos.testbed import SCENARIO
from tests.simulation import plan
from tests.simulation.__main__ import repeatedly
from tests.simulation.faults import FAULT_KINDS
from tests.simulation.outcome import simulate
from tests.simulation.summary import Summary


def make_simulate(run: Path, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "tests.simulation", *arguments],
        cwd=ROOT,
        env={**os.environ, "REACTIVE_ARM_RUN_DIR": str(run), **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_progress_is_told_at_once_and_at_the_end() -> None:
    calls: list[float] = []
    with repeatedly(lambda: calls.append(time.monotonic())):
        begin = time.monotonic()
        while not calls:
            assert time.monotonic() < begin + 10.0
    assert calls[-1] >= begin
    assert len(calls) >= 2


def test_the_same_seed_gives_the_same_record(tmp_path: Path) -> None:
    run = make_simulate(tmp_path, "--hours", "0.01", "--seed", "7")
    output, _ = run.communicate()
    assert run.returncode == 0
    (experiment,) = plan.experiments("7", 0.01, 5.0, tuple(FAULT_KINDS))
    assert f"record {Summary.of(simulate(experiment)).digest}\n" in output
    assert "seed 7" in output
    assert "times real time" in output


def test_a_schedule_is_played_and_reported(tmp_path: Path) -> None:
    path = tmp_path / "schedule.yaml"
    faults = [PlannedFault(5.0, "kill", "operator_watchdog")]
    parameters = {"/engine_controller": {"ros__parameters": {"presence_timeout": 5.0}}}
    save(Experiment("1", 10.0, SCENARIO, faults, parameters), path)
    run = make_simulate(tmp_path, "--schedule", str(path))
    output, errors = run.communicate()
    assert (run.returncode, errors) == (0, "")
    report = re.search(r"Report: (.*)", output)
    assert report is not None
    assert "<html" in Path(report[1]).read_text(encoding="utf-8")
    assert load(tmp_path / "simulation" / "1.yaml").parameters == parameters


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--hours", "much"], "'much' is not a number"),
        (["--faults", "magic"], "'magic' is not one of kill,"),
        (["--schedule", "nowhere.yaml"], "nowhere.yaml: No such file or directory"),
        (["--parameters", "nowhere.yaml"], "nowhere.yaml: No such file or directory"),
        (["--parameters", "mine.yaml", "--systematic", "1"], "--parameters are for random faults"),
    ],
)
def test_a_users_mistake_is_one_line(arguments: list[str], reason: str, tmp_path: Path) -> None:
    run = make_simulate(tmp_path, *arguments)
    _, errors = run.communicate()
    assert run.returncode in (1, 2)
    assert reason in errors.splitlines()[-1]
    assert "Traceback" not in errors


def test_ctrl_c_gives_the_verdict_so_far_or_ends(tmp_path: Path) -> None:
    run = make_simulate(tmp_path, "--hours", "24", "--seed", "1")
    assert run.stdout is not None
    assert "seed 1" in run.stdout.readline()
    run.send_signal(signal.SIGINT)
    output, errors = run.communicate(timeout=150)
    assert run.returncode == 130
    assert "Interrupted" in output
    assert errors == ""


def test_worker_that_is_killed_is_one_line(tmp_path: Path) -> None:
    run = make_simulate(tmp_path, "--hours", "24", "--seed", "1")
    children = Path(f"/proc/{run.pid}/task/{run.pid}/children")
    deadline = time.monotonic() + 60.0
    while not (workers := [pid for pid in children.read_text().split() if is_worker(int(pid))]):
        assert time.monotonic() < deadline, "no worker has begun"
        time.sleep(0.05)
    os.kill(int(workers[0]), signal.SIGKILL)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 1
    (line,) = errors.splitlines()
    assert line.startswith("A worker process was killed, perhaps because memory ran out.")


def is_worker(pid: int) -> bool:
    return b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()


@pytest.mark.parametrize("module", ["tests.simulation", "tests.replay"])
def test_an_rclpy_that_cannot_be_simulated_is_one_line(module: str, tmp_path: Path) -> None:
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").touch()
    code = f"import runpy, sys; sys.path.insert(0, {str(tmp_path)!r}); runpy.run_module({module!r})"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("A simulation cannot run here: rclpy_ground needs ROS 2's own rclpy")


def test_ctrl_c_leaves_nothing_behind(tmp_path: Path) -> None:
    run = make_simulate(tmp_path / "run", "--hours", "24", "--seed", "1", TMPDIR=str(tmp_path))
    assert run.stdout is not None
    assert "seed 1" in run.stdout.readline()
    deadline = time.monotonic() + 60.0
    while not any(path.is_dir() for path in tmp_path.glob("reactive-arm-*/reactive-arm-*")):
        assert time.monotonic() < deadline, "no experiment has begun"
        time.sleep(0.05)
    run.send_signal(signal.SIGINT)
    run.communicate(timeout=150)
    assert not list(tmp_path.glob("reactive-arm-*"))
