"""The variables of SROS2 choose the library, the keys and the properties with which a participant joins."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from rclpy.context import Context

from rclpy_ground.cyclonedds import domain, log, security
from rclpy_ground.genuine import RCLError

KEYS = (
    "identity_ca.cert.pem",
    "cert.pem",
    "key.pem",
    "permissions_ca.cert.pem",
    "governance.p7s",
    "permissions.p7s",
)


@pytest.fixture
def secured(tmp_path: Path) -> dict[str, str]:
    """An environment with a library, and keys of /arm1/talker."""
    library = tmp_path / "lib" / "libddsc.so"
    plugins = library.parent / "libddsc0debian"
    plugins.mkdir(parents=True)
    enclave = tmp_path / "keystore" / "enclaves" / "arm1" / "talker"
    enclave.mkdir(parents=True)
    for path in (library, *(plugins / f"libdds_security_{kind}.so" for kind in ("auth", "ac", "crypto"))):
        path.touch()
    for name in KEYS:
        (enclave / name).touch()
    return {
        "ROS_SECURITY_ENABLE": "true",
        "ROS_SECURITY_KEYSTORE": str(tmp_path / "keystore"),
        "CYCLONEDDS_LIBRARY": str(library),
    }


def test_properties_are_those_of_rmw_cyclonedds(secured: dict[str, str], tmp_path: Path) -> None:
    enclave = f"file:{tmp_path}/keystore/enclaves/arm1/talker"
    plugin = f"{tmp_path}/lib/libddsc0debian/libdds_security"
    assert security.properties("/arm1/talker", secured) == {
        "dds.sec.auth.identity_ca": f"{enclave}/identity_ca.cert.pem",
        "dds.sec.auth.identity_certificate": f"{enclave}/cert.pem",
        "dds.sec.auth.private_key": f"{enclave}/key.pem",
        "dds.sec.access.permissions_ca": f"{enclave}/permissions_ca.cert.pem",
        "dds.sec.access.governance": f"{enclave}/governance.p7s",
        "dds.sec.access.permissions": f"{enclave}/permissions.p7s",
        "dds.sec.auth.library.path": f"{plugin}_auth.so",
        "dds.sec.auth.library.init": "init_authentication",
        "dds.sec.auth.library.finalize": "finalize_authentication",
        "dds.sec.access.library.path": f"{plugin}_ac.so",
        "dds.sec.access.library.init": "init_access_control",
        "dds.sec.access.library.finalize": "finalize_access_control",
        "dds.sec.crypto.library.path": f"{plugin}_crypto.so",
        "dds.sec.crypto.library.init": "init_crypto",
        "dds.sec.crypto.library.finalize": "finalize_crypto",
    }


def test_an_enclave_of_the_environment_wins(secured: dict[str, str]) -> None:
    overridden = secured | {"ROS_SECURITY_ENCLAVE_OVERRIDE": "/arm1/talker"}
    assert security.properties("/", overridden) == security.properties("/arm1/talker", secured)


@pytest.mark.parametrize("value", ["", "false", "TRUE"])
def test_security_is_off_unless_true(value: str, secured: dict[str, str]) -> None:
    assert security.properties("/arm1/talker", secured | {"ROS_SECURITY_ENABLE": value}) == {}
    environment = {"ROS_SECURITY_ENABLE": value, "CYCLONEDDS_LIBRARY": "/nowhere"}
    assert domain.configuration(environment) == domain.configuration({})


@pytest.mark.parametrize("strategy", ["Enforce", "Permissive", None])
def test_without_a_library_security_is_refused_in_one_line(
    strategy: str | None, monkeypatch: pytest.MonkeyPatch, domain_id: int
) -> None:
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    monkeypatch.setenv("CYCLONEDDS_LIBRARY", "/nowhere")
    if strategy is not None:
        monkeypatch.setenv("ROS_SECURITY_STRATEGY", strategy)
    with pytest.raises(
        RCLError, match=r"^ROS_SECURITY_ENABLE is true, [^\n]* CYCLONEDDS_LIBRARY=/nowhere [^\n]*$"
    ):
        Context().init(args=[], domain_id=domain_id)


def test_a_library_without_plugins_has_no_security(secured: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "lib" / "libddsc0debian" / "libdds_security_crypto.so").unlink()
    assert security.library(secured) is None


@pytest.mark.parametrize("missing", KEYS)
def test_each_file_of_an_enclave_is_needed(missing: str, secured: dict[str, str], tmp_path: Path) -> None:
    path = tmp_path / "keystore" / "enclaves" / "arm1" / "talker" / missing
    path.unlink()
    with pytest.raises(RCLError, match=f"^ROS_SECURITY_ENABLE is true, but there is no {path}$"):
        security.properties("/arm1/talker", secured)


@pytest.mark.parametrize("enclave", ["/", ""])
def test_a_process_without_an_enclave_learns_how_to_name_one(enclave: str, secured: dict[str, str]) -> None:
    with pytest.raises(RCLError, match=r"/enclaves/identity_ca.cert.pem: name an enclave in ROS_SECURITY_E"):
        security.properties(enclave, secured)


def test_a_keystore_is_needed(secured: dict[str, str]) -> None:
    del secured["ROS_SECURITY_KEYSTORE"]
    with pytest.raises(RCLError, match=r"ROS_SECURITY_KEYSTORE names no keystore$"):
        security.properties("/arm1/talker", secured)


HEARD = "1.5 [7] dq.builtin: Remote secure participant 1:2:3:1c1 not allowed\n"
REFUSED = "1.5 [7]     python: Could not find domain 7\n(code: 141)\n"


def test_reasons_of_a_failure_are_reported_once(capfd: pytest.CaptureFixture[str]) -> None:
    def join() -> None:
        with log.kept() as reasons:
            os.write(2, (HEARD + "another thread\n" + REFUSED).encode())
            raise RuntimeError(f"refused{reasons()}")

    with pytest.raises(RuntimeError, match=r"^refused: Could not find domain 7$"):
        join()
    print("after", file=sys.stderr)
    assert capfd.readouterr().err == "another thread\nafter\n"


def test_a_process_that_joins_does_not_report_whom_it_heard(capfd: pytest.CaptureFixture[str]) -> None:
    with log.kept():
        os.write(2, (HEARD + REFUSED).encode())
    assert capfd.readouterr().err == REFUSED
