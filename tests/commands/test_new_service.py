from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.commands import new_service
from deploy.supervision.processes import ROOT

NO_NAME = "must be a name of up to 30 small letters, such as torque_guard"
NO_NAMES = ("", "Torque", "../torque", "a__b", "a" * 31, "class")
FILES = ("conftest.py", "pyproject.toml", "Makefile", "README.md", "CONTRIBUTING.md", "CHANGELOG.md")


def run(directory: Path, *words: str) -> subprocess.CompletedProcess[str]:
    path = [str(directory), *filter(None, [os.environ.get("PYTHONPATH")])]  # of a sourced ROS 2
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(path),
        "MYPYPATH": str(directory / "stubs"),
    }
    command = [sys.executable, "-m", *words]
    return subprocess.run(
        command, cwd=directory, env=environment, capture_output=True, text=True, check=False, timeout=240
    )


def make(directory: Path, name: str) -> str:
    """Run the command; returns its error, or nothing."""
    return run(directory, "deploy.commands.new_service", name).stderr


def content(directory: Path) -> dict[Path, bytes]:
    return {
        path: path.read_bytes()
        for folder in ("services", "interfaces", "tests", "deploy")
        for path in (directory / folder).rglob("*")
        if path.suffix in (".py", ".md", ".conf") and "runtime" not in path.parts
    }


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    ignored = shutil.ignore_patterns("runtime", "tools", "browser", "*.mcap", "__pycache__", "*_cache")
    for name in ("deploy", "interfaces", "services", "tests"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=ignored)
    for name in ("runtime", "tools"):
        (tmp_path / "deploy" / name).symlink_to(ROOT / "deploy" / name)
    for name in FILES:
        shutil.copyfile(ROOT / name, tmp_path / name)
    return tmp_path


def test_new_services_are_green_at_once_and_need_three_places_besides_their_test(checkout: Path) -> None:
    before = content(checkout)
    assert make(checkout, "trial_guard") == ""
    after = content(checkout)
    assert {str(path.relative_to(checkout)) for path in after if before.get(path) != after[path]} == {
        "services/trial_guard.py",
        "tests/component/test_trial_guard.py",
        "interfaces/topics.py",
        "deploy/supervisord.conf",
        "interfaces/README.md",
        "services/README.md",
    }
    assert make(checkout, "trial_alarm") == ""

    tests = [f"tests/component/test_{name}.py" for name in ("trial_guard", "contract", "readme", "topics")]
    tests += ["tests/supervision/test_manifest.py", "tests/chaos/test_schedule.py"]
    for command in (
        ("ruff", "check", "."),
        ("ruff", "format", "--check", "services", "interfaces", "tests/component"),
        ("pytest", "-q", "-p", "no:cacheprovider", *tests),
        ("deploy.commands.stubs", "stubs"),
        ("mypy", "-p", "services", "-p", "interfaces"),
    ):
        done = run(checkout, *command)
        assert done.returncode == 0, done.stdout + done.stderr
    written = (checkout / "services" / "trial_guard.py").read_text()
    assert not {"speed", "fast", "m/s"} & set(written.replace("_", " ").split())


@pytest.mark.parametrize(
    "name", ["wheel_speeds", "too_fast", "speed_guard_2", "my_sentinel", "speed", "values"]
)
def test_a_name_may_contain_a_word_of_the_template(checkout: Path, name: str) -> None:
    assert make(checkout, name) == ""
    found = run(checkout, "pytest", "-q", "-p", "no:cacheprovider", f"tests/component/test_{name}.py")
    assert found.returncode == 0, found.stdout
    written = (checkout / "deploy" / "supervisord.conf").read_text()
    assert f"\n[program:{name}]\n" in written
    assert f" -m services.{name} " in written
    assert f'"{name}/input"' in (checkout / "interfaces" / "topics.py").read_text()


@pytest.mark.parametrize(
    ("name", "error"),
    [
        *((name, f"NAME={name}: {NO_NAME}") for name in NO_NAMES),
        ("kinematics", "NAME=kinematics: is taken by services/kinematics.py"),
        ("examples", "NAME=examples: is taken by services/examples"),
        ("listing_5_9", "NAME=listing_5_9: is taken by tests/component/test_listing_5_9.py"),
    ],
)
def test_bad_or_taken_name_is_refused(name: str, error: str) -> None:
    with pytest.raises(new_service.Refused, match=f"^{error}$"):
        new_service.check(name)


@pytest.mark.parametrize(
    ("name", "file"), [("sentinel", "deploy/supervisord.conf"), ("engines", "interfaces/topics.py")]
)
def test_name_in_the_manifest_or_contract_is_refused_with_its_line(name: str, file: str) -> None:
    with pytest.raises(new_service.Refused, match=rf"^NAME={name}: is taken by {file}, line \d+: .*{name}"):
        new_service.check(name)


@pytest.mark.parametrize("path", ["deploy/supervisord.conf", "interfaces/topics.py"])
def test_file_without_the_place_for_a_service_changes_nothing(checkout: Path, path: str) -> None:
    file = checkout / path
    text = file.read_text().replace("operator_page, sentinel", "sentinel")
    file.write_text(text.replace("DIAGNOSTICS = Topic(", "DIAGNOSTICS = Topic ("))
    before = content(checkout)
    error = make(checkout, "trial_guard")
    assert error.startswith(f"make new-service: {path}: needs one `")
    assert error.count("\n") == 1
    assert content(checkout) == before


def test_file_that_cannot_be_written_changes_nothing(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = Path.write_text

    def refuse(path: Path, text: str, **options: str) -> int:
        if path.name == "supervisord.conf":
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return write(path, text, **options)

    before = content(checkout)
    monkeypatch.setattr(new_service, "ROOT", checkout)
    monkeypatch.setattr(Path, "write_text", refuse)
    monkeypatch.setattr(sys, "argv", ["new_service", "trial_guard"])
    monkeypatch.setattr(new_service, "use_plain_output", lambda: None)  # pytest keeps its own output
    with pytest.raises(SystemExit, match=r"supervisord.conf: Permission denied; nothing is written$"):
        new_service.main()
    assert content(checkout) == before


def test_error_in_the_contract_is_reported_with_its_line(checkout: Path) -> None:
    contract = checkout / "interfaces" / "topics.py"
    before, _, after = contract.read_text().partition("DRIVE_TIMEOUT = 0.4")
    contract.write_text(f"{before}DRIVE_TIMEOUT = 1 / 0{after}")
    line = before.count("\n") + 1
    before = content(checkout)
    error = make(checkout, "trial_guard")
    where = f"interfaces/topics.py, line {line}: ZeroDivisionError: "
    assert error.startswith(f"make new-service: deploy.commands.tables: {where}")
    assert error.count("\n") == 1
    assert content(checkout) == before
