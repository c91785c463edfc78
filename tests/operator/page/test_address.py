from __future__ import annotations

import socket
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from deploy.operator.page import address
from deploy.operator.page.address import AddressFile, host_names, listen, tls
from deploy.supervision.run_directory import PAGE_FILE
from interfaces.service import UserError
from tests.ports import free_port

LINE = "The page: http://127.0.0.1:8650/#tok-en_1"


@pytest.fixture
def taken() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as other:
        yield other.getsockname()[1]


def test_port_that_was_asked_for_is_used(taken: int) -> None:
    port = free_port()
    with listen("127.0.0.1", port) as listener:
        assert listener.getsockname() == ("127.0.0.1", port)


def test_taken_port_is_reported_in_one_line(taken: int) -> None:
    with pytest.raises(
        OSError, match=f"^port {taken} of 127.0.0.1 is taken: choose another one with WEB=<port>$"
    ):
        listen("127.0.0.1", taken)


def test_next_port_is_used_when_the_default_is_taken(taken: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(address, "DEFAULT_PORT", taken)
    with listen("127.0.0.1", taken) as listener:
        assert taken < listener.getsockname()[1] < taken + address.PORTS


def test_last_port_is_used_again(taken: int, monkeypatch: pytest.MonkeyPatch) -> None:
    with listen("127.0.0.1", address.DEFAULT_PORT) as one:
        last = one.getsockname()[1] + 1
    with listen("127.0.0.1", address.DEFAULT_PORT, last) as again:
        assert again.getsockname()[1] == last


@pytest.mark.parametrize("host", ["192.0.2.1", "300.0.0.1"])
def test_foreign_address_is_reported_in_one_line(host: str) -> None:
    with pytest.raises(OSError, match=r"^\S+ port 8000: [^\n]+$"):
        listen(host, 8000)


def test_loopback_needs_no_tls() -> None:
    assert tls("127.0.0.1", "", "") is None


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.2"])
def test_other_addresses_need_tls(host: str) -> None:
    with pytest.raises(UserError, match="set certificate and key"):
        tls(host, "", "")


@pytest.mark.parametrize("host", ["localhost", "::1", ""])
def test_address_is_numeric(host: str) -> None:
    with pytest.raises(UserError, match="is not an IPv4 address"):
        tls(host, "", "")


def test_bad_certificate_is_reported(tmp_path: Path) -> None:
    (tmp_path / "bad.pem").write_text("nonsense")
    for certificate in (tmp_path / "missing.pem", tmp_path / "bad.pem"):
        with pytest.raises(UserError, match=f"^certificate '{certificate}' or key '{certificate}': "):
            tls("0.0.0.0", str(certificate), str(certificate))
        with pytest.raises(UserError, match=f"^certificate '{certificate}': "):
            tls("0.0.0.0", str(certificate), "")


def test_host_names_are_exact() -> None:
    assert host_names("127.0.0.1", []) == ("127.0.0.1", "localhost")
    assert host_names("0.0.0.0", ["arm.example"]) == ("arm.example",)


@pytest.mark.parametrize("name", ["küche.local", "arm.example:8642", "https://arm.example"])
def test_name_that_no_browser_sends_is_refused(name: str) -> None:
    with pytest.raises(UserError, match=f"^names: '{name}' must consist of ASCII letters"):
        host_names("0.0.0.0", ["arm.example", name])


def test_address_of_all_networks_needs_names() -> None:
    with pytest.raises(UserError, match=r"^names: must be the names of this machine in browsers"):
        host_names("0.0.0.0", [])


def test_restarted_process_keeps_port_and_token(tmp_path: Path) -> None:
    AddressFile(str(tmp_path)).write(LINE)

    assert AddressFile(str(tmp_path)).read() == (8650, "tok-en_1")


def test_each_start_has_a_token_of_its_own(tmp_path: Path) -> None:
    tokens = {AddressFile(folder).read()[1] for folder in (str(tmp_path), str(tmp_path / "missing"), "")}

    assert len(tokens) == 3
    assert all(len(token) >= 43 for token in tokens), "256 random bits"


@pytest.mark.parametrize("content", [b"", b"No page: it is off\n", b"\xff\xfe", LINE.encode()[:-5]])
def test_other_content_gives_a_new_token(tmp_path: Path, content: bytes) -> None:
    (tmp_path / PAGE_FILE).write_bytes(content)

    port, token = AddressFile(str(tmp_path)).read()
    assert port is None
    assert len(token) >= 43


def test_only_the_user_can_read_the_address(tmp_path: Path) -> None:
    folder = tmp_path / "settings"
    AddressFile(str(folder)).write(LINE)
    AddressFile(str(folder)).write(LINE)

    assert stat.S_IMODE((folder / PAGE_FILE).stat().st_mode) == 0o600
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert [path.name for path in folder.iterdir()] == [PAGE_FILE]


def test_unwritable_folder_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"page\.txt: "):
        AddressFile(str(tmp_path / "file")).write(LINE)
