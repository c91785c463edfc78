from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

from deploy.commands import unit
from deploy.supervision.errors import DeploymentError
from tests.system.systemd import command_of, environment_of

UNPLEASANT = 'it\'s 100 % $HOME "fine" \\ %n \\n\n\r\n\tend'


def test_the_unit_starts_this_checkout_with_its_environment(tmp_path: Path) -> None:
    parameters = tmp_path / UNPLEASANT / "page.yaml"
    parameters.parent.mkdir()
    parameters.touch()
    environment = {
        "RUNTIME": "cyclonedds",
        "ROS_DOMAIN_ID": "7",
        "REACTIVE_ARM_RUN_DIR": str(tmp_path / UNPLEASANT),
        "WEB": "off",
        "ROS_STATIC_PEERS": "",
        "CYCLONEDDS_URI": "<CycloneDDS>\n\t<Domain/>\r\n</CycloneDDS>\n",
        "SHELL": "/bin/bash",
        "WEBHOOK_TOKEN": "secret",
        "RUNTIME_KEY": "secret",
    }
    content = unit.text("demo", str(parameters), environment)
    shell, script, *words = command_of(content)
    assert (shell, script) == ("/bin/sh", str(unit.ROOT / "deploy" / "commands" / "venv.sh"))
    assert words == ["-m", "deploy.commands.launcher", "become", "demo", str(parameters)]
    kept = ("RUNTIME", "ROS_DOMAIN_ID", "REACTIVE_ARM_RUN_DIR", "WEB", "CYCLONEDDS_URI")
    assert environment_of(content) == {name: environment[name] for name in kept}


def test_files_are_named_from_the_root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").touch()
    assert command_of(unit.text("mine.yaml", "", {}))[-2:] == [str(tmp_path / "mine.yaml"), ""]


@pytest.mark.parametrize(
    ("environment", "name"),
    [
        ({}, "reactive-arm.service"),
        ({"REACTIVE_ARM_NAMESPACE": "/"}, "reactive-arm.service"),
        ({"REACTIVE_ARM_NAMESPACE": "/cell/arm1"}, "reactive-arm-cell-arm1.service"),
    ],
)
def test_each_arm_has_a_unit_of_its_own(tmp_path: Path, environment: Mapping[str, str], name: str) -> None:
    path = unit.write("[Unit]\n", {"XDG_CONFIG_HOME": str(tmp_path)} | environment)
    assert path == tmp_path / "systemd" / "user" / name
    assert path.read_text() == "[Unit]\n"


def test_a_unit_replaces_that_of_the_same_arm_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    environment = {"XDG_CONFIG_HOME": str(tmp_path)}
    ours = {"REACTIVE_ARM_RUN_DIR": str(tmp_path / "arm1")}

    def write(scenario: str, given: Mapping[str, str] = ours) -> Path:
        return unit.write(unit.text(scenario, "", given), environment)

    write("demo")
    content = write("listing_5_9").read_text()
    assert "listing_5_9" in content
    refused = r"reactive-arm.service is the unit of another arm: .*\(REACTIVE_ARM_NAMESPACE=/arm2\)"
    for of_another in ({}, {"REACTIVE_ARM_RUN_DIR": str(tmp_path / "arm2")}):
        with pytest.raises(DeploymentError, match=refused):
            write("demo", of_another)
    monkeypatch.setattr(unit, "ROOT", tmp_path / "another checkout")
    with pytest.raises(DeploymentError, match=refused):
        write("demo")
    assert (tmp_path / "systemd" / "user" / "reactive-arm.service").read_text() == content


def test_a_unit_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "systemd").touch()
    with pytest.raises(DeploymentError, match=r"/reactive-arm.service: Not a directory$"):
        unit.write("", {"XDG_CONFIG_HOME": str(tmp_path)})


def test_a_full_disk_leaves_the_old_unit(tmp_path: Path) -> None:
    environment = {"XDG_CONFIG_HOME": str(tmp_path)}
    path = unit.write("[Unit]\n", environment)
    path.with_suffix(".new").symlink_to("/dev/full")
    with pytest.raises(DeploymentError, match=r"/reactive-arm.service: No space left on device$"):
        unit.write("[Unit]\n" * 2, environment)
    assert path.read_text() == "[Unit]\n"


def test_systemd_accepts_the_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not shutil.which("systemd-analyze"):
        pytest.skip("platform: no systemd-analyze")
    root = tmp_path / UNPLEASANT
    (root / "deploy" / "commands").mkdir(parents=True)
    monkeypatch.setattr(unit, "ROOT", root)
    content = unit.text(str(root / "none.yaml"), "", {"REACTIVE_ARM_RUN_DIR": str(root)})
    path = unit.write(content, {"XDG_CONFIG_HOME": str(tmp_path)})
    verify = ["systemd-analyze", "--system", "verify", str(path)]
    done = subprocess.run(verify, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
