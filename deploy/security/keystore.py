"""A keystore as SROS2 makes it, for any rclpy with DDS Security. openssl's command line makes the keys.

::

    public/   ca.cert.pem, and links to it: identity_ca.cert.pem, permissions_ca.cert.pem
    private/  ca.key.pem, and links to it; an export has no such folder
    enclaves/ governance.xml, governance.p7s (signed), and a folder for each enclave with cert.pem,
              key.pem, permissions.xml, permissions.p7s (signed), and links to CA and governance
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

from deploy.security import documents
from deploy.security.rights import Rights
from deploy.supervision.errors import DeploymentError
from deploy.supervision.lock import held
from interfaces.service.enclave import SOON

CA = "sros2CA"  # the name that SROS2 gives it
BEFORE, AFTER = timedelta(days=1), timedelta(days=3650)
"""From when to when keys are valid, as in SROS2: a host whose clock is behind must be able to join."""
_SETTINGS = """\
[req]
prompt = no
distinguished_name = name
[name]
CN = {name}
[ca]
default_ca = own
[own]
database = {folder}/index
new_certs_dir = {folder}
rand_serial = yes
default_md = sha256
policy = policy
x509_extensions = extensions
[policy]
commonName = supplied
[extensions]
basicConstraints = {constraints}
subjectKeyIdentifier = none
authorityKeyIdentifier = none
"""
_LINKED_TO_CA = ("identity_ca", "permissions_ca")


class Keystore:
    """The keystore in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._enclaves = folder / "enclaves"
        self._ca = folder / "public" / "ca.cert.pem"
        self._ca_key = folder / "private" / "ca.key.pem"

    def write(self, rights: Mapping[str, Rights], domains: Collection[int]) -> datetime:
        """
        Write governance and enclaves. Keys stay; certificates that end soon and permissions are made again.

        :param rights: those of each enclave, such as ``/kinematics``.
        :param domains: the ROS domains in which they join.
        :return: when the first of these enclaves ends, in UTC.
        :raises DeploymentError: if openssl is missing or fails, or if this is an export, which has no CA key.
        """
        with _private():
            self.folder.mkdir(parents=True, exist_ok=True)
            with held(self.folder, "keystore"):  # two at once would leave a CA with the key of the other
                self._write_ca()
                self._sign(self._enclaves / "governance", documents.governance(domains))
                return min(self._write_enclave(enclave, each, domains) for enclave, each in rights.items())

    def enclaves(self) -> list[str]:
        """Return the enclaves that exist, sorted."""
        found = self._enclaves.glob("**/cert.pem")
        return sorted(f"/{path.parent.relative_to(self._enclaves).as_posix()}" for path in found)

    def check(self, enclaves: Collection[str], domain: int) -> None:
        """Raise DeploymentError unless this user can join a ROS domain by each of these enclaves."""
        governance = self._enclaves / "governance.xml"
        try:
            domains = documents.domains(governance.read_text())
        except PermissionError:
            raise _unreadable(governance) from None
        except (OSError, ValueError):
            raise DeploymentError(f"{self.folder} is no keystore: make keystore") from None
        if domains and domain not in domains:  # SROS2 may name ranges
            known = ", ".join(map(str, sorted(domains)))
            raise DeploymentError(f"{self.folder} is for ROS domain {known}, not {domain}: make keystore")
        if missing := sorted({*enclaves} - {*self.enclaves()}):
            others = f" and {len(missing) - 1} others" if missing[1:] else ""
            raise DeploymentError(f"{self.folder} has no keys for {missing[0]}{others}: make keystore")
        for enclave in enclaves:
            key = self._enclaves / enclave.lstrip("/") / "key.pem"
            if key.exists() and not os.access(key, os.R_OK):
                raise _unreadable(key)

    def export(self, folder: Path, enclaves: Collection[str]) -> None:
        """Copy what the host of these enclaves needs: no key of the CA, and none of another enclave.

        :raises DeploymentError: if the folder exists, or an enclave does not.
        """
        if missing := sorted({*enclaves} - {*self.enclaves()}):
            raise DeploymentError(f"{self.folder} has no enclave {', '.join(missing)}")
        if folder.exists():
            raise DeploymentError(f"{folder} exists already: an export needs a new folder")
        with _private():
            shutil.copytree(self.folder / "public", folder / "public", symlinks=True)
            (folder / "enclaves").mkdir()
            for document in ("governance.xml", "governance.p7s"):
                shutil.copy2(self._enclaves / document, folder / "enclaves")
            for enclave in enclaves:
                place = enclave.lstrip("/")
                shutil.copytree(self._enclaves / place, folder / "enclaves" / place, symlinks=True)

    def _write_ca(self) -> None:
        if self._ca.exists() and not self._ca_key.exists():
            raise DeploymentError(
                f"{self.folder} has no key of its CA: add and renew enclaves where it was made"
            )
        for folder in (self._ca.parent, self._ca_key.parent, self._enclaves):
            folder.mkdir(parents=True, exist_ok=True)
        if not _lasts(self._ca):
            self._certify(CA, self._ca, self._ca_key, "critical,CA:true,pathlen:1")
        for name in _LINKED_TO_CA:
            _link(self._ca.with_name(f"{name}.cert.pem"), self._ca)
            _link(self._ca_key.with_name(f"{name}.key.pem"), self._ca_key)

    def _write_enclave(self, enclave: str, rights: Rights, domains: Collection[int]) -> datetime:
        """Write an enclave, and return when it ends."""
        folder = self._enclaves / enclave.lstrip("/")
        folder.mkdir(parents=True, exist_ok=True)
        certificate, key = folder / "cert.pem", folder / "key.pem"
        if not (key.exists() and _lasts(certificate)):
            self._certify(enclave, certificate, key, "CA:false")
        for name in _LINKED_TO_CA:
            _link(folder / f"{name}.cert.pem", self._ca.with_name(f"{name}.cert.pem"))
        _link(folder / "governance.p7s", self._enclaves / "governance.p7s")
        begin, end = _validity(certificate)
        self._sign(folder / "permissions", documents.permissions(enclave, rights, domains, (begin, end)))
        return end

    def _certify(self, name: str, certificate: Path, key: Path, constraints: str) -> None:
        """Make a certificate, and a key on P-256 if there are not both yet: a key alone may be incomplete."""
        with TemporaryDirectory() as folder:
            settings, request = (Path(folder, name) for name in ("settings", "request"))
            made = certificate.with_suffix(".new")
            settings.write_text(_SETTINGS.format(name=name, folder=folder, constraints=constraints))
            Path(folder, "index").touch()
            new_key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-keyout", key)
            its_key = ("-key", key) if certificate.exists() and key.exists() else new_key
            _openssl("req", "-config", settings, "-new", "-sha256", *its_key, "-out", request)
            now = datetime.now(UTC)
            end = now + AFTER if name == CA else min(now + AFTER, _validity(self._ca)[1])
            times = ("-startdate", f"{now - BEFORE:%Y%m%d%H%M%SZ}", "-enddate", f"{end:%Y%m%d%H%M%SZ}")
            signer = (
                ("-cert", self._ca, "-keyfile", self._ca_key)
                if name != CA
                else ("-selfsign", "-keyfile", key)
            )
            _openssl(
                "ca", "-config", settings, "-batch", "-notext", *times, *signer, "-in", request, "-out", made
            )
        os.replace(made, certificate)

    def _sign(self, document: Path, text: str) -> None:
        """Write NAME.xml and, signed, NAME.p7s. A process that starts reads the old or the new one."""
        plain, signed = document.with_suffix(".xml"), document.with_suffix(".p7s")
        new = document.with_suffix(".new")
        plain.write_text(text)
        signer = ("-signer", self._ca, "-inkey", self._ca_key)
        _openssl("smime", "-sign", "-text", "-in", plain, "-out", new, *signer)
        os.replace(new, signed)


def _unreadable(path: Path) -> DeploymentError:
    return DeploymentError(f"{path} belongs to another user: an arm starts with keys that its user can read")


def _lasts(certificate: Path) -> bool:
    """Whether there is a certificate that does not end soon."""
    return certificate.exists() and _validity(certificate)[1] > datetime.now(UTC) + SOON


def _validity(certificate: Path) -> tuple[datetime, datetime]:
    """Return from when to when a certificate is valid, in UTC."""
    text = _openssl("x509", "-in", certificate, "-noout", "-startdate", "-enddate")
    begin, end = (
        datetime.strptime(line.partition("=")[2], "%b %d %H:%M:%S %Y GMT").replace(tzinfo=UTC)
        for line in text.splitlines()
    )
    return begin, end


def _link(link: Path, target: Path) -> None:
    if not link.is_symlink():
        link.symlink_to(os.path.relpath(target, link.parent))


def _openssl(*arguments: str | Path) -> str:
    try:
        done = subprocess.run(["openssl", *arguments], capture_output=True, text=True)
    except FileNotFoundError:
        raise DeploymentError("A keystore needs the command openssl 3: apt-get install openssl") from None
    if done.returncode:
        raise DeploymentError(f"openssl {arguments[0]}: {' '.join(done.stderr.split())}")
    return done.stdout


@contextmanager
def _private() -> Iterator[None]:
    """Make files that only the user can read."""
    mask = os.umask(0o077)
    try:
        yield
    finally:
        os.umask(mask)
