"""`make test`, `make test-all`: runs of pytest; the later ones have the tests with bounds of time."""

from __future__ import annotations

import importlib.util
import re
import subprocess
from pathlib import Path

import pytest

from deploy.supervision.processes import ROOT
from tests import __main__ as command
from tests import order, tiers

HERE = command.Part("", "", ["tests/system", "-x"])
CYCLONEDDS = "tests/commands/test_fleet.py tests/security/attacks"
SIMULATED = "tests/replay tests/simulation tests/simulation_kit"
IGNORED = "--ignore=tests/replay"
ONE = "tests/simulation/test_experiment.py::test"
SMOKE = ("tests/simulation/test_minute.py", "tests/system/test_start_kill_stop.py")


@pytest.mark.parametrize(
    ("codes", "result"),
    [([5, 5, 5], 5), ([0, 5, 5], 0), ([5, 0, 5], 0), ([1, 0, 0], 1), ([0, 5, 1], 1), ([2], 2), ([0, 3], 3)],
)
def test_exit_code_is_the_worst_and_an_interruption_ends_it(
    monkeypatch: pytest.MonkeyPatch, codes: list[int], result: int
) -> None:
    left = list(codes)
    monkeypatch.setattr(subprocess, "call", lambda command, env: left.pop(0))
    assert command.main(["tests/system", "-x"]) == result
    assert left == []


def test_every_test_runs_once_and_timed_ones_with_few_others(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    commands: list[list[str]] = []
    monkeypatch.setattr(subprocess, "call", lambda command, env: commands.append(command) or 0)
    command.run(HERE, tmp_path)
    assert [each[-5:-1] for each in commands] == [
        ["-m", mark, "tests/system", "-x"] for mark in ("not timed and not alone", "timed", "alone")
    ]
    many, few, one = (int(each[each.index("-n") + 1]) for each in commands)
    assert many > few
    assert one == 1


def test_an_expression_selects_in_each_phase_and_untimed_leaves_only_the_first(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    commands: list[list[str]] = []
    monkeypatch.setattr(subprocess, "call", lambda command, env: commands.append(command) or 0)
    command.run(HERE._replace(arguments=["tests", "-m", "unit or node", "-x"]), tmp_path)
    assert [each[-5:-1] for each in commands] == [
        ["-m", f"(unit or node) and {mark}", "tests", "-x"]
        for mark in ("not timed and not alone", "timed", "alone")
    ]
    commands.clear()
    command.main(["--untimed", "tests/system"])
    assert [each[-4:-1] for each in commands] == [["-m", "not timed and not alone", "tests/system"]]


@pytest.mark.parametrize(
    ("file", "fixtures", "expected"),
    [
        ("tests/component/test_kinematics.py", ["scheduler"], "unit"),
        ("tests/component/test_effector_wiring.py", ["make_node", "domain_id"], "node"),
        ("tests/component/test_service_life.py", ["domain_id"], "arm"),
        ("tests/system/test_demo.py", ["domain_id"], "arm"),
        ("tests/simulation/test_experiment.py", [], "unit"),
    ],
)
def test_tier_is_that_of_what_a_test_starts(file: str, fixtures: list[str], expected: str) -> None:
    assert tiers.tier(ROOT / file, fixtures) == expected


def test_workers_share_compiled_modules_and_the_runtime(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    environments: list[dict[str, str]] = []
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setattr(subprocess, "call", lambda command, env: environments.append(env) or 0)
    command.run(HERE._replace(runtime="cyclonedds"), tmp_path)
    assert not any("PYTHONDONTWRITEBYTECODE" in environment for environment in environments)
    assert {environment["RUNTIME"] for environment in environments} == {"cyclonedds"}


def arguments(words: str) -> dict[str, str]:
    """Return the arguments of each part, by the name of its rclpy."""
    return {part.rclpy.split()[0]: " ".join(part.arguments) for part in command.parts(words.split())}


@pytest.mark.parametrize(
    ("words", "on_ros", "in_virtual_time", "on_cyclonedds"),
    [
        ("tests/system -x", "-x tests/system", None, None),
        ("tests/simulation -x", None, "-x tests/simulation", None),
        ("tests -x", "-x tests", f"-x {SIMULATED}", f"-x {CYCLONEDDS}"),
        (
            f"tests {IGNORED}",
            f"{IGNORED} tests",
            f"{IGNORED} {SIMULATED.partition(' ')[2]}",
            f"{IGNORED} {CYCLONEDDS}",
        ),
        (f"{ONE} tests/page", "tests/page", ONE, None),
    ],
)
def test_each_test_runs_on_one_rclpy(
    words: str,
    on_ros: str | None,
    in_virtual_time: str | None,
    on_cyclonedds: str | None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(command, "sourced_rclpy", lambda: "")
    expected = {"ROS": on_ros, "Virtual": in_virtual_time, "Cyclone": on_cyclonedds}
    assert arguments(words) == {name: text for name, text in expected.items() if text}


def test_sourced_ros_runs_no_test_of_cyclone_dds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(command, "sourced_rclpy", lambda: "/opt/ros/rclpy")
    assert arguments("tests") == {"ROS": "tests", "Virtual": SIMULATED}


def test_cyclone_dds_runs_every_test(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCLPY_GROUND", "cyclonedds")
    assert arguments("tests deploy/ground") == {"Cyclone": "tests deploy/ground"}


def test_file_without_a_collected_test_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("tests/a/test_one.py", "tests/a/test_two.py", "tests/page/test_three.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    seen = ["tests.a.test_one.TestIt.test_passes", ".tests.a.test_twofold"]
    assert command.uncollected(["tests"], seen) == [
        "tests/a/test_two.py",
        "tests/page/test_three.py",
    ]
    assert command.uncollected(["tests", "--ignore=tests/page"], seen) == ["tests/a/test_two.py"]
    assert command.uncollected(["tests", "-k", "word"], seen) == []
    assert command.uncollected(["tests/a/test_two.py::test"], seen) == []


@pytest.mark.parametrize(
    ("words", "missing"),
    [
        ("tests interfaces/reactive_node --ignore=tests/page -x", ""),
        ("tests/commands/test_test_command.py::test_workers -k word -x", ""),
        ("nix", "nix"),
        (
            "tests --ignore=tests/page nix/test_it.py::test tests/nix",
            "nix/test_it.py::test, tests/nix",
        ),
    ],
)
def test_a_missing_path_is_named_and_nothing_runs(
    words: str, missing: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    commands: list[list[str]] = []
    monkeypatch.setattr(subprocess, "call", lambda command, env: commands.append(command) or 0)
    assert command.main(words.split()) == (4 if missing else 0)
    assert bool(commands) != bool(missing)
    assert capsys.readouterr().err == (f"TESTS: {missing}: no such file or directory\n" if missing else "")


def test_every_test_belongs_to_test_all_and_ci_ends_with_it() -> None:
    folders = re.search(r"(?m)^ALL_TESTS := (.*)$", (ROOT / "Makefile").read_text())
    assert folders
    assert "--ignore" not in folders[1]
    found = {path for folder in folders[1].split() for path in (ROOT / folder).rglob("test_*.py")}
    rooms = ("services", "interfaces", "deploy", "tests")
    assert {path for room in rooms for path in (ROOT / room).rglob("test_*.py")} == found
    assert (ROOT / ".ci/run").read_text().endswith('make test-all\nexit "$failed"\n')


def test_a_minute_is_for_each_recipe_a_real_arm_and_chaos() -> None:
    default = re.search(r"(?m)^TESTS \?= ((?:.*\\\n)*.*)$", (ROOT / "Makefile").read_text())
    assert default
    words = f" {default[1]} "
    for path in ("tests/component", "tests/promises", *SMOKE):
        assert f" {path} " in words
        assert (ROOT / path).exists()
    assert '-m "not arm or minute" --untimed' in words
    assert "pytest.mark.minute" in (ROOT / SMOKE[1]).read_text()


def test_longest_files_begin_first_and_exist() -> None:
    assert [path for path in order.LONGEST if not (ROOT / path).exists()] == []
    tests = ["tests/a.py::test_2", "tests/a.py::test_1", *(f"{path}::test" for path in order.LONGEST[::-1])]
    assert sorted(tests, key=order.place) == [*tests[:1:-1], *tests[:2]]


NOTHING = command.Results(set(), set(), set())
TESTS = """
import pytest

def test_passes(): pass

@pytest.mark.parametrize("number", [1, 2])
def test_fails(number): assert not number

@pytest.fixture
def broken():
    yield
    raise LookupError

def test_fails_with_its_fixture(broken): raise ValueError

def test_is_skipped(): pytest.skip("it is")
"""


def test_last_line_counts_the_tests_of_all_phases(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    timed = "@pytest.mark.timed\ndef test_passes_in_time(): pass"
    (tmp_path / "test_it.py").write_text(f"{TESTS}\n{timed}")
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n  timed\n  alone")
    monkeypatch.setattr(command, "PHASES", dict.fromkeys(command.PHASES, 1))  # each worker takes its time
    assert command.main([str(tmp_path), "-c", str(tmp_path / "pytest.ini")]) == 1
    assert capfd.readouterr().out.splitlines()[-1] == "2 passed, 3 failed, 1 skipped"


def test_last_line_follows_a_warning_if_not_all_tests_have_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls: list[list[str]] = []
    monkeypatch.setattr(subprocess, "call", lambda command, env: calls.append(command) or 2)
    assert command.main(["tests/system", "tests/simulation"]) == 2
    assert len(calls) == 1  # not even another part
    assert capsys.readouterr().out.splitlines()[1:] == ["Not all tests have run.", str(NOTHING)]
