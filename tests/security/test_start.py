"""A system that shall be secure starts with the keys of all its processes, or not at all."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from deploy.commands import parameters
from deploy.commands.member import Member
from deploy.security import documents
from deploy.security.keystore import Keystore
from deploy.supervision import manifest
from deploy.supervision.environment import of_supervisord
from deploy.supervision.errors import DeploymentError
from deploy.supervision.processes import ROOT
from deploy.supervision.system import System
from interfaces.service import enclave
from interfaces.service.enclave import Keys
from tests.system.sites import Site

PROGRAMS = [program.name for program in manifest.programs(manifest.PATH)]


@pytest.fixture
def keystore(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, domain_id: int) -> Path:
    """The keystore of an arm, as far as it is looked at; the environment wants security."""
    folder = tmp_path / "keystore"
    for name in (*PROGRAMS, "terminal"):
        (folder / "enclaves" / name).mkdir(parents=True)
        for file in ("cert.pem", "key.pem"):
            (folder / "enclaves" / name / file).touch()
    (folder / "enclaves" / "governance.xml").write_text(documents.governance([domain_id]))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    monkeypatch.setenv("ROS_SECURITY_STRATEGY", "Enforce")
    monkeypatch.setenv("ROS_SECURITY_KEYSTORE", "keystore")
    return folder


def check(tmp_path: Path) -> str:
    try:
        parameters.check_environment(System(tmp_path / "run"))
    except DeploymentError as error:
        return str(error)
    return ""


def test_all_keys_are_there(keystore: Path, tmp_path: Path) -> None:
    assert check(tmp_path) == ""
    assert os.environ["ROS_SECURITY_KEYSTORE"] == str(keystore)  # services work in another directory


@pytest.mark.parametrize("name", ["terminal", "operator_page"])
def test_a_process_without_keys_is_named(name: str, keystore: Path, tmp_path: Path) -> None:
    (keystore / "enclaves" / name / "cert.pem").unlink()
    assert check(tmp_path) == f"{keystore} has no keys for /{name}: make keystore"


def test_keys_that_have_ended_start_nothing(keystore: Path, tmp_path: Path) -> None:
    permissions = keystore / "enclaves" / "velocity" / "permissions.p7s"
    permissions.write_text("<not_before>2025-01-01</not_before><not_after>2026-01-01</not_after>")
    assert check(tmp_path) == (
        "the keys of /velocity have ended at 2026-01-01 00:00 UTC: make keystore, then make stop and start"
    )


def test_terminal_ends_with_its_keys(domain_id: int, monkeypatch: pytest.MonkeyPatch) -> None:
    now = datetime.now(UTC)
    ended = Keys("/terminal", now - timedelta(days=1), now)
    monkeypatch.setattr(enclave, "keys", lambda _: ended)
    with Member() as member:
        for spin in (member.spin_once, member.spin_some):
            with pytest.raises(DeploymentError, match=r"^the keys of /terminal have ended at "):
                spin()


@pytest.mark.parametrize("kind", ["nothing", "a file", "an empty folder", "another governance"])
def test_what_is_no_keystore_is_reported(kind: str, keystore: Path, tmp_path: Path) -> None:
    if kind == "another governance":
        (keystore / "enclaves" / "governance.xml").write_text("<dds")
    else:
        shutil.rmtree(keystore)
    if kind == "a file":
        keystore.touch()
    elif kind == "an empty folder":
        keystore.mkdir()
    assert check(tmp_path) == f"{keystore} is no keystore: make keystore"


def test_keys_are_for_their_ros_domain(keystore: Path, tmp_path: Path, domain_id: int) -> None:
    (keystore / "enclaves" / "governance.xml").write_text(documents.governance([200, 107]))
    assert check(tmp_path) == f"{keystore} is for ROS domain 107, 200, not {domain_id}: make keystore"


def test_keys_of_another_user_are_reported(
    keystore: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whose = "belongs to another user: an arm starts with keys that its user can read"
    with monkeypatch.context() as patch:
        patch.setattr(os, "access", lambda path, _: "velocity" not in str(path))
        assert check(tmp_path) == f"{keystore}/enclaves/velocity/key.pem {whose}"

    def refuse(_: Path) -> str:
        raise PermissionError

    monkeypatch.setattr(Path, "read_text", refuse)  # root may read all files
    assert check(tmp_path) == f"{keystore}/enclaves/governance.xml {whose}"


def test_keys_of_another_namespace_do_not_count(
    keystore: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("REACTIVE_ARM_NAMESPACE", "/arm1")
    others = len(PROGRAMS)
    assert check(tmp_path) == f"{keystore} has no keys for /arm1/config_l1 and {others} others: make keystore"


@pytest.mark.parametrize("keystore_name", [None, ""])
def test_a_keystore_has_to_be_named(
    keystore_name: str | None, keystore: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_SECURITY_KEYSTORE", keystore_name or "")
    if keystore_name is None:
        monkeypatch.delenv("ROS_SECURITY_KEYSTORE")
    assert check(tmp_path).startswith("ROS_SECURITY_ENABLE=true needs ROS_SECURITY_KEYSTORE: ")


def test_a_strategy_that_lets_strangers_join_is_refused(
    keystore: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_SECURITY_STRATEGY", "Permissive")
    reason = "ROS_SECURITY_STRATEGY=Permissive lets processes join without keys: set it to Enforce"
    assert check(tmp_path) == reason


def test_processes_of_an_arm_enforce_security_each_with_its_own_enclave() -> None:
    shell = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_ENCLAVE_OVERRIDE": "/tools"}
    inherited = of_supervisord(shell, Path("/run"))
    assert inherited["ROS_SECURITY_STRATEGY"] == "Enforce"
    assert "ROS_SECURITY_ENCLAVE_OVERRIDE" not in inherited
    assert "ROS_SECURITY_STRATEGY" not in of_supervisord({}, Path("/run"))


def test_an_enclave_is_chosen_only_with_security(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "TRUE")
    assert enclave.arguments("kinematics", "/") == []
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    assert enclave.arguments("kinematics", "/arm1") == ["--ros-args", "--enclave", "/arm1/kinematics"]
    assert enclave.arguments("kinematics", "") == ["--ros-args", "--enclave", "/kinematics"]


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        ("SECURE=yes", ["true", "Enforce", f"{ROOT}/.keystore"]),
        ("SECURE=yes ROS_SECURITY_KEYSTORE=keys", ["true", "Enforce", "keys"]),
        ("", []),
    ],
)
def test_secure_is_short_for_the_variables_of_ros_2(words: str, shown: list[str]) -> None:
    print_them = (
        "--eval=show: ; @printenv ROS_SECURITY_ENABLE ROS_SECURITY_STRATEGY ROS_SECURITY_KEYSTORE; true"
    )
    command = ["make", print_them, "--eval=USED_BY_show := SECURE", "show", *words.split()]
    outside = {name: it for name, it in os.environ.items() if not name.startswith(("MAKE", "ROS_"))}
    done = subprocess.run(command, cwd=ROOT, env=outside, capture_output=True, text=True)
    assert done.stdout.split() == shown, done.stderr


def test_secure_is_yes_or_empty() -> None:
    outside = {name: it for name, it in os.environ.items() if not name.startswith("MAKE")}
    command = ["make", "start", "SECURE=maybe"]
    done = subprocess.run(command, cwd=ROOT, env=outside, capture_output=True, text=True)
    assert done.returncode == 2
    assert "SECURE=maybe: it is yes, or empty" in done.stderr


class KeyedSite(Site):
    @property
    def environment(self) -> dict[str, str]:
        return super().environment | {"ROS_SECURITY_KEYSTORE": str(self.run.parent / "keys")}


def test_make_keystore_writes_an_arm_and_exports_a_host(tmp_path: Path, domain_id: int) -> None:
    site = KeyedSite(tmp_path / "run", domain_id, "/arm1")
    export = tmp_path / "host"
    code, printed = site.do("keystore", str(export), "terminal sentinel /fleet")
    assert code == 0, printed
    count = len(PROGRAMS) + len(manifest.sentinels()) + 4
    first, *others = printed.splitlines()
    assert re.fullmatch(
        f"{tmp_path}/keys: {count} enclaves for ROS domain {domain_id}, namespace /arm1,"
        r" valid until \d{4}-\d{2}-\d{2}",
        first,
    )
    assert others == [f"{export}: /arm1/terminal, /arm1/sentinel, /fleet; copy this folder to their host"]
    assert len(Keystore(tmp_path / "keys").enclaves()) == count
    assert Keystore(export).enclaves() == ["/arm1/sentinel", "/arm1/terminal", "/fleet"]
    code, printed = site.do("keystore", str(tmp_path / "other"))
    assert (code, printed.count("\n")) == (1, 0)
    assert "An export needs both" in printed


def test_a_program_of_the_user_has_an_enclave(tmp_path: Path, domain_id: int) -> None:
    own = tmp_path / "robot.conf"
    own.write_text("[program:twist_gate]\ncommand = python3 -m services.examples.twist_gate\n")
    site = KeyedSite(tmp_path / "run", domain_id)
    done = subprocess.run(
        site.command(("keystore",)), env=site.environment | {"MANIFEST": str(own)}, cwd=ROOT
    )
    assert done.returncode == 0
    assert "/twist_gate" in Keystore(tmp_path / "keys").enclaves()
