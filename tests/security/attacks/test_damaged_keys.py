"""Who cannot join with keys that are damaged, of others or expired; the rows of A2 in deploy/SAFETY.md."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest

from deploy.security import keystore as keystores
from deploy.security import rights
from deploy.security.keystore import Keystore
from tests.chaos import clock
from tests.chaos.faults import INJECTED
from tests.security.attacks.conftest import (
    ATTEMPTS,
    PROGRAMS,
    STATE,
    MakePeer,
    Peer,
    Refused,
    SecureSite,
    permissions,
    until,
)


@pytest.fixture
def copy(secure_site: SecureSite, tmp_path: Path) -> Keystore:
    """A copy of the keys, to be damaged."""
    folder = tmp_path / "copy"
    shutil.copytree(secure_site.keystore.folder, folder, symlinks=True)
    return Keystore(folder)


def test_tampered_permissions_do_not_join(make_peer: MakePeer, copy: Keystore) -> None:
    path = copy.folder / "enclaves" / "velocity" / "permissions.p7s"
    path.write_text(path.read_text().replace("rt/effector/speed", "rt/engines"))
    with pytest.raises(Refused, match="cannot join DDS domain"):
        make_peer("velocity", ROS_SECURITY_KEYSTORE=str(copy.folder))


def test_permissions_of_another_enclave_do_not_join(make_peer: MakePeer, copy: Keystore) -> None:
    enclaves = copy.folder / "enclaves"
    shutil.copy(enclaves / "terminal" / "permissions.p7s", enclaves / "velocity" / "permissions.p7s")
    with pytest.raises(Refused, match="cannot join DDS domain"):
        make_peer("velocity", ROS_SECURITY_KEYSTORE=str(copy.folder))


def test_an_expired_certificate_does_not_join(make_peer: MakePeer, copy: Keystore, tmp_path: Path) -> None:
    folder = copy.folder / "enclaves" / "velocity"
    request, certificate, key = tmp_path / "request.pem", folder / "cert.pem", folder / "key.pem"
    ca, ca_key = copy.folder / "public" / "ca.cert.pem", copy.folder / "private" / "ca.key.pem"
    for words in (
        f"x509 -x509toreq -in {certificate} -signkey {key} -out {request}",
        f"x509 -req -in {request} -CA {ca} -CAkey {ca_key} -days -1 -set_serial 7 -out {certificate}",
    ):
        subprocess.run(["openssl", *words.split()], check=True)
    with pytest.raises(Refused, match=r"cannot join DDS domain [^\n]* expired"):
        make_peer("velocity", ROS_SECURITY_KEYSTORE=str(copy.folder))


@pytest.fixture
def late(tmp_path: Path) -> Iterator[dict[str, str]]:
    """The environment of a process whose clock is two hours behind."""
    if reason := clock.missing():
        pytest.skip(reason)
    offset = tmp_path / "offset"
    offset.write_text("-7200\n")
    path = os.pathsep.join(filter(None, [str(INJECTED), os.environ.get("PYTHONPATH")]))
    with clock.faked() as environment:
        yield environment | clock.Clock(offset).environment() | {"PYTHONPATH": path}


def test_others_refuse_a_certificate_that_has_expired(
    secure_site: SecureSite,
    make_peer: MakePeer,
    watcher: Peer,
    copy: Keystore,
    late: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its own library takes it, because its clock is behind."""
    valid = make_peer("terminal_5", "terminal", **late)
    until(lambda: "terminal_5" in watcher("nodes"))  # such a clock keeps nobody out
    valid.close()  # by its clock, the other is valid
    (copy.folder / "enclaves" / "terminal" / "cert.pem").unlink()
    monkeypatch.setattr(keystores, "AFTER", -timedelta(hours=1))
    copy.write({"/terminal": rights.of_arm("/", PROGRAMS)["/terminal"]}, [secure_site.domain])
    shutil.copy(permissions(secure_site.keystore, "terminal"), permissions(copy, "terminal"))

    expired = make_peer("terminal_6", "terminal", ROS_SECURITY_KEYSTORE=str(copy.folder), **late)

    time.sleep(ATTEMPTS)
    assert expired("nodes") == ["terminal_6"]
    assert "terminal_6" not in watcher("nodes")


def test_keys_that_end_stop_their_own_service_until_they_are_renewed(
    secure_site: SecureSite, watcher: Peer, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, keystore = "velocity", secure_site.keystore
    own = {f"/{name}": rights.of_arm("/", PROGRAMS)[f"/{name}"]}
    (keystore.folder / "enclaves" / name / "cert.pem").unlink()
    with monkeypatch.context() as patch:
        patch.setattr(keystores, "AFTER", timedelta(seconds=10))
        keystore.write(own, [secure_site.domain])
    os.kill(secure_site.members[name], signal.SIGKILL)

    log = secure_site.run / "logs" / f"{name}.log"
    until(lambda: f"{name}: the keys of /{name} have ended at " in log.read_text())
    watcher("heard", STATE)
    until(lambda: watcher("heard", STATE))  # the others go on
    keystore.write(own, [secure_site.domain])

    until(lambda: re.search(rf"{name} +RUNNING .*(?:ago|never)", secure_site.do("status")[1]))


def test_status_shows_the_processes_though_its_keys_have_ended(secure_site: SecureSite) -> None:
    permissions = secure_site.keystore.folder / "enclaves" / "terminal" / "permissions.p7s"
    whole = permissions.read_bytes()
    permissions.write_bytes(re.sub(rb"<not_after>\d+", b"<not_after>2001", whole))
    code, shown = secure_site.do("status")
    permissions.write_bytes(whole)
    assert code == 1
    assert re.search("^kinematics +[A-Z]+ .* (no report|-)$", shown, re.MULTILINE), shown
    assert re.search("^Cannot join the ROS graph: the keys of /terminal have ended", shown, re.MULTILINE)


def test_no_keys_at_all_do_not_join(make_peer: MakePeer) -> None:
    with pytest.raises(Refused, match=r"^ROS_SECURITY_ENABLE is true, but there is no [^\n]*nobody/[^\n]*$"):
        make_peer("nobody")
