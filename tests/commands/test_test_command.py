"""`make test`: runs of pytest; the later ones have the tests with bounds of time."""

from __future__ import annotations

import importlib.util
import re
import subprocess
from pathlib import Path

import pytest

from tests import __main__ as command
from tests import order

ROOT = Path(__file__).parents[2]

HERE = command.Part("", "", ["tests/system", "-x"])
EMBEDDED = (
    "tests/commands/test_fleet.py tests/mutants tests/security/attacks tests/replay"
    " tests/simulation tests/simulation_kit"
)
IGNORED = "--ignore=tests/mutants"
ONE = "tests/simulation/test_experiment.py::test"


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


def test_workers_share_compiled_modules_and_the_runtime(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    environments: list[dict[str, str]] = []
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setattr(subprocess, "call", lambda command, env: environments.append(env) or 0)
    command.run(HERE._replace(runtime="embedded"), tmp_path)
    assert not any("PYTHONDONTWRITEBYTECODE" in environment for environment in environments)
    assert {environment["RUNTIME"] for environment in environments} == {"embedded"}


def arguments(words: str) -> dict[str, str]:
    """Return the arguments of each part, by the name of its rclpy."""
    return {part.rclpy.split()[0]: " ".join(part.arguments) for part in command.parts(words.split())}


@pytest.mark.parametrize(
    ("words", "on_ros", "on_embedded"),
    [
        ("tests/system -x", "-x tests/system", None),
        ("tests/simulation -x", None, "-x tests/simulation"),
        ("tests -x", "-x tests", f"-x {EMBEDDED}"),
        (f"tests {IGNORED}", f"{IGNORED} tests", f"{IGNORED} {EMBEDDED.replace('tests/mutants ', '')}"),
        (f"{ONE} tests/page", "tests/page", ONE),
    ],
)
def test_each_test_runs_on_one_rclpy(
    words: str, on_ros: str | None, on_embedded: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(command, "sourced_rclpy", lambda: "")
    expected = {"ROS": on_ros, "Embedded": on_embedded}
    assert arguments(words) == {name: text for name, text in expected.items() if text}


def test_sourced_ros_runs_no_test_of_the_embedded_rclpy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(command, "sourced_rclpy", lambda: "/opt/ros/rclpy")
    assert arguments("tests") == {"ROS": "tests"}


def test_embedded_rclpy_runs_every_test(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name)
    assert arguments("tests deploy/runtime") == {"Embedded": "tests deploy/runtime"}


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


def test_ci_runs_what_make_test_leaves_out() -> None:
    left_out = re.search(r"(?m)^LEFT_OUT := (.*)$", (ROOT / "Makefile").read_text())
    runs = re.findall(r'make test TESTS="([^"]+)"', (ROOT / ".ci/run").read_text())
    assert left_out
    for path in left_out[1].split():
        assert (ROOT / path).exists()
        assert any(
            path not in command.ignored(words.split())
            and any(Path(path).is_relative_to(folder) for folder in command.paths(words.split()))
            for words in runs
        )


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
    monkeypatch.setattr(subprocess, "call", lambda command, env: 2)
    assert command.main(["tests/system"]) == 2
    assert capsys.readouterr().out.splitlines()[1:] == ["Not all tests have run.", str(NOTHING)]
