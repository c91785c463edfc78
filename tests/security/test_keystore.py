"""The keystore is one of SROS2: compared with what SROS2 makes, and verified by openssl."""

from __future__ import annotations

import shutil
import stat
import subprocess
import sys
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from xml.etree import ElementTree

import pytest

from deploy.security import keystore as keystores
from deploy.security.keystore import Keystore
from deploy.security.rights import Rule
from deploy.supervision.errors import DeploymentError
from deploy.supervision.lock import held
from interfaces.service.enclave import SOON
from tests.security import sros2

TALKER = {"/talker": (Rule(frozenset({"rt/rosout", "rt/chatter"}), frozenset({"rt/clock"})),)}
DENIED = Rule(frozenset({"rt/x"}), frozenset({"rt/y"}), allows=False)
OTHER = {"/arm1/other": (*TALKER["/talker"], DENIED, Rule(frozenset({"rt/*"}), frozenset()))}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Keystore:
    keystore = Keystore(tmp_path_factory.mktemp("keys") / "keystore")
    keystore.write(TALKER | OTHER, [7])
    return keystore


def openssl(*arguments: object) -> str:
    done = subprocess.run(["openssl", *map(str, arguments)], capture_output=True, text=True, check=True)
    return done.stdout


def layout(folder: Path) -> dict[str, str]:
    found = sorted(path for path in folder.rglob("*") if path.is_symlink() or path.is_file())
    return {
        str(path.relative_to(folder)): str(path.readlink()) if path.is_symlink() else "" for path in found
    }


def elements(document: Path) -> Iterator[tuple[str, tuple[str, ...], str]]:
    for element in ElementTree.parse(document).iter():
        attributes = tuple(word for pair in element.attrib.items() for word in pair)
        yield element.tag, attributes, (element.text or "").strip()


def test_files_and_links_are_those_of_sros2(made: Keystore) -> None:
    found = layout(made.folder)
    others = {name for name in found if name.startswith("enclaves/arm1/")}
    assert {name: found[name] for name in found if name not in others} == sros2.KEYSTORE | sros2.ENCLAVE
    assert len(others) == len(sros2.ENCLAVE)
    assert all((made.folder / name).exists() for name in found)  # no broken link
    assert made.enclaves() == ["/arm1/other", "/talker"]


def test_only_the_user_reads_the_keys(made: Keystore) -> None:
    readable = stat.S_IRWXG | stat.S_IRWXO
    assert not [
        path for path in made.folder.rglob("*") if path.lstat().st_mode & readable and not path.is_symlink()
    ]


def test_certificates_are_those_of_sros2(made: Keystore) -> None:
    ca, own = made.folder / "public" / "ca.cert.pem", made.folder / "enclaves" / "talker" / "cert.pem"
    for certificate, subject, constraints in (
        (ca, sros2.CA_SUBJECT, "X509v3 Basic Constraints: critical\n                CA:TRUE, pathlen:1"),
        (own, sros2.SUBJECT, "X509v3 Basic Constraints: \n                CA:FALSE"),
    ):
        text = openssl("x509", "-in", certificate, "-noout", "-text", "-nameopt", "RFC2253")
        assert f"Issuer: {sros2.CA_SUBJECT}\n" in text
        assert f"Subject: {subject}\n" in text
        assert constraints in text
        assert text.count("X509v3 ") == 2  # the heading, and this extension
        assert "Signature Algorithm: ecdsa-with-SHA256" in text
        assert "ASN1 OID: prime256v1" in text
        dates = openssl("x509", "-in", certificate, "-noout", "-dates").splitlines()
        begin, end = (datetime.strptime(date.split("=")[1], "%b %d %H:%M:%S %Y GMT") for date in dates)
        length = timedelta(days=sros2.DAYS_BEFORE + sros2.DAYS_AFTER)  # the CA's, which was made before
        assert timedelta() <= length - (end - begin) < timedelta(minutes=1)
        assert abs(datetime.now(UTC).replace(tzinfo=None) - begin - timedelta(days=1)) < timedelta(hours=1)
    assert openssl("verify", "-CAfile", ca, own).strip().endswith("OK")
    key = own.with_name("key.pem")
    assert key.read_text().startswith("-----BEGIN PRIVATE KEY-----\n")  # PKCS #8
    assert openssl("pkey", "-in", key, "-pubout") == openssl("x509", "-in", own, "-noout", "-pubkey")


@pytest.mark.parametrize("name", ["governance", "talker/permissions"])
def test_documents_are_signed_as_by_sros2(made: Keystore, name: str, tmp_path: Path) -> None:
    signed = made.folder / "enclaves" / f"{name}.p7s"
    ca = made.folder / "public" / "permissions_ca.cert.pem"
    first, second = signed.read_text().splitlines()[:2]
    assert first == sros2.SIGNED[0]
    assert second.startswith(sros2.SIGNED[1])

    content = openssl("smime", "-verify", "-text", "-in", signed, "-CAfile", ca)

    assert content.replace("\r\n", "\n") == signed.with_suffix(".xml").read_text()
    tampered = tmp_path / "tampered.p7s"
    tampered.write_text(signed.read_text().replace("<id>7</id>", "<id>8</id>"))
    with pytest.raises(subprocess.CalledProcessError):
        openssl("smime", "-verify", "-text", "-in", tampered, "-CAfile", ca)


def test_governance_is_that_of_sros2(made: Keystore) -> None:
    assert list(elements(made.folder / "enclaves" / "governance.xml")) == sros2.GOVERNANCE


def test_permissions_have_the_form_of_sros2(made: Keystore) -> None:
    folder = made.folder / "enclaves" / "talker"
    begin, end = (
        datetime.strptime(date.split("=")[1], "%b %d %H:%M:%S %Y GMT").isoformat()
        for date in openssl("x509", "-in", folder / "cert.pem", "-noout", "-dates").splitlines()
    )
    times = {"BEGIN": begin, "END": end}
    expected = [(name, attributes, times.get(text, text)) for name, attributes, text in sros2.PERMISSIONS]
    assert list(elements(folder / "permissions.xml")) == expected


def test_rules_keep_their_order(made: Keystore) -> None:
    grant = ElementTree.parse(made.folder / "enclaves/arm1/other/permissions.xml").find("permissions/grant")
    assert grant is not None
    assert [each.tag for each in grant][2:] == [
        "allow_rule",
        "deny_rule",
        "allow_rule",
        "allow_rule",
        "default",
    ]
    assert [each.text for each in grant.iterfind("deny_rule//topic")] == ["rt/x", "rt/y"]


def test_writing_again_keeps_keys_and_renews_permissions(tmp_path: Path) -> None:
    keystore = Keystore(tmp_path / "keystore")
    keystore.write(TALKER, [7])
    kept = {path: path.read_bytes() for path in keystore.folder.rglob("*.pem")}
    keystore.write(OTHER | {"/talker": (Rule(frozenset({"rt/new"}), frozenset()),)}, [8])
    assert {path: path.read_bytes() for path in kept} == kept
    text = (keystore.folder / "enclaves/talker/permissions.p7s").read_text()
    assert "<topic>rt/new</topic>" in text
    assert "<id>8</id>" in text


@pytest.mark.parametrize("lost", ["cert.pem", "key.pem"])
def test_a_key_that_is_interrupted_or_lost_is_made_again(lost: str, tmp_path: Path) -> None:
    keystore = Keystore(tmp_path / "keystore")
    keystore.write(TALKER, [7])
    certificate = keystore.folder / "enclaves/talker/cert.pem"
    certificate.with_name(lost).unlink()
    keystore.write(TALKER, [7])
    of_key = openssl("pkey", "-in", certificate.with_name("key.pem"), "-pubout")
    assert of_key == openssl("x509", "-in", certificate, "-noout", "-pubkey")


def test_a_second_make_waits_for_the_first(tmp_path: Path) -> None:
    write = "import sys; from pathlib import Path; from deploy.security.keystore import Keystore"
    write += "; Keystore(Path(sys.argv[1])).write({'/talker': ()}, [7])"
    with held(tmp_path, "keystore"):
        second = subprocess.Popen([sys.executable, "-c", write, tmp_path], stdout=subprocess.PIPE, text=True)
        assert second.stdout is not None
        assert second.stdout.readline() == "Waiting for another make to end its keystore.\n"
        assert layout(tmp_path) == {}
    second.communicate()
    assert second.returncode == 0
    assert Keystore(tmp_path).enclaves() == ["/talker"]


def test_writing_again_renews_what_ends_soon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keystore = Keystore(tmp_path / "keystore")
    monkeypatch.setattr(keystores, "AFTER", SOON - timedelta(hours=1))
    first = keystore.write(TALKER | OTHER, [7])
    keys = {path: path.read_bytes() for path in keystore.folder.rglob("*key.pem")}
    old = tmp_path / "old.pem"
    shutil.copy(keystore.folder / "enclaves/talker/cert.pem", old)
    monkeypatch.undo()

    renewed = keystore.write(TALKER | OTHER, [7])

    assert renewed - first > timedelta(days=3600)
    assert {path: path.read_bytes() for path in keys} == keys
    ca = keystore.folder / "public" / "ca.cert.pem"
    for certificate in (old, *keystore.folder.glob("enclaves/**/cert.pem")):  # they meet until the restart
        assert openssl("verify", "-CAfile", ca, certificate).strip().endswith("OK")
    for enclave in ("talker", "arm1/other"):
        signed = keystore.folder / "enclaves" / enclave / "permissions.p7s"
        text = openssl("smime", "-verify", "-text", "-in", signed, "-CAfile", ca)
        assert f"<not_after>{renewed.replace(tzinfo=None).isoformat()}</not_after>" in text


def test_no_certificate_outlives_its_ca(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keystore = Keystore(tmp_path / "keystore")
    monkeypatch.setattr(keystores, "AFTER", timedelta(days=100))
    end = keystore.write(TALKER, [7])
    monkeypatch.undo()
    assert keystore.write(TALKER | OTHER, [7]) == end
    dates = openssl("x509", "-in", keystore.folder / "enclaves/arm1/other/cert.pem", "-noout", "-enddate")
    assert datetime.strptime(dates.strip(), "notAfter=%b %d %H:%M:%S %Y GMT").replace(tzinfo=UTC) == end


def test_an_export_has_its_own_keys_and_no_key_of_the_ca(made: Keystore, tmp_path: Path) -> None:
    folder = tmp_path / "host"
    made.export(folder, ["/arm1/other"])
    assert [str(path.relative_to(folder)) for path in folder.rglob("*key.pem")] == [
        "enclaves/arm1/other/key.pem"
    ]
    assert all(path.exists() for path in folder.rglob("*"))
    assert Keystore(folder).enclaves() == ["/arm1/other"]
    with pytest.raises(DeploymentError, match="has no key of its CA: add and renew"):
        Keystore(folder).write(TALKER, [7])


def test_an_export_refuses_what_it_cannot_do(made: Keystore, tmp_path: Path) -> None:
    with pytest.raises(DeploymentError, match=r"has no enclave /nobody$"):
        made.export(tmp_path / "host", ["/nobody", "/talker"])
    with pytest.raises(DeploymentError, match="exists already"):
        made.export(tmp_path, ["/talker"])


def test_without_openssl_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert shutil.which("openssl") is None
    with pytest.raises(DeploymentError, match=r"^[^\n]*apt-get install openssl$"):
        Keystore(tmp_path / "keystore").write(TALKER, [7])


def test_what_openssl_says_is_one_line(tmp_path: Path) -> None:
    keystore = Keystore(tmp_path / "keystore")
    keystore.write(TALKER, [7])
    (keystore.folder / "private" / "ca.key.pem").write_text("no key")
    with pytest.raises(DeploymentError, match=r"^openssl smime: [^\n]+$"):
        keystore.write(TALKER, [7])
