"""A page gets the records of the arm with its token, and no other files."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from deploy.operator.page import records, server
from tests.operator.page.clients import TOKEN, Arm, update

STOP = "stop-20260101-120000.123.mcap"
WHOLE = "20260101-110000.mcap"
BEARER = f"Bearer {TOKEN}"
CONTENT = bytes(range(256)) * 4096


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[Arm]:
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "index.html").write_text("<!doctype html>")
    arm = Arm(tmp_path / "files")
    arm.records.mkdir()
    for name in (STOP, WHOLE, "notes.txt", "20269999-999999.mcap"):
        (arm.records / name).write_bytes(CONTENT)
    (tmp_path / "secret.mcap").write_text("secret")
    yield arm
    arm.close()


def listed(arm: Arm) -> list[Any]:
    status, head, body = arm.get("/records", Authorization=BEARER)
    assert status == 200
    assert "Content-Type: application/json" in head
    return list(json.loads(body))


def test_records_are_listed_by_the_time_of_the_scenario(arm: Arm) -> None:
    now = time.time()
    for name in (STOP, WHOLE):
        os.utime(arm.records / name, (now, now - 5.0))
    stop, whole = listed(arm)
    assert (stop["name"], whole["name"]) == (STOP, WHOLE)
    noon = time.mktime((2026, 1, 1, 12, 0, 0, 0, 0, -1))
    assert stop["begin"] == pytest.approx(1.25 - (now - noon), abs=1.0)
    assert stop["begin"] - whole["begin"] == pytest.approx(3600.0)
    assert stop["end"] == pytest.approx(1.25 - 5.0, abs=1.0)


def test_record_is_served_whole(arm: Arm) -> None:
    status, head, body = arm.get(f"/records/{STOP}", Authorization=BEARER)
    assert status == 200
    assert f"Content-Length: {len(CONTENT)}" in head.splitlines()
    assert body == CONTENT
    assert "Cache-Control: no-store" in head


def test_record_that_grows_is_served_as_it_was(arm: Arm) -> None:
    path = arm.records / STOP
    with socket.create_connection(("127.0.0.1", arm.port), timeout=5.0) as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        request = f"GET /records/{STOP} HTTP/1.1\r\nHost: {arm.host}\r\nAuthorization: {BEARER}\r\n\r\n"
        client.sendall(request.encode())
        answer = client.recv(1000)
        with path.open("ab") as file:
            file.write(b"more")
        while part := client.recv(65536):
            answer += part
    assert answer.partition(b"\r\n\r\n")[2] == CONTENT


def test_slow_download_holds_no_page_up(arm: Arm) -> None:
    (arm.records / STOP).write_bytes(32 * CONTENT)
    with socket.create_connection(("127.0.0.1", arm.port), timeout=5.0) as client, arm.page() as page:
        request = f"GET /records/{STOP} HTTP/1.1\r\nHost: {arm.host}\r\nAuthorization: {BEARER}\r\n\r\n"
        client.sendall(request.encode())
        assert client.recv(10)
        for _ in range(5):
            assert update(page)


@pytest.mark.parametrize("path", ["/records", f"/records/{STOP}", "/records/other.mcap"])
@pytest.mark.parametrize("given", ["", "Bearer ", "Bearer s3cr3t-tokeN", f"Basic {TOKEN}x", "Bearer é"])
def test_without_the_token_nothing_is_served(arm: Arm, path: str, given: str) -> None:
    status, _, body = arm.get(path, Authorization=given)
    assert status == 403
    assert CONTENT[:100] not in body
    assert "token" in arm.next(server.Violation).reason


@pytest.mark.parametrize(
    "name",
    [
        "",
        "notes.txt",
        "20269999-999999.mcap",
        "../secret.mcap",
        "%2e%2e/secret.mcap",
        "..%2fsecret.mcap",
        f"./{STOP}",
        f"{STOP}?x",
        f"{STOP}/",
        "stop-20260101-120001.000.mcap",
        "/etc/passwd",
    ],
)
def test_no_other_file_is_served(arm: Arm, name: str) -> None:
    assert arm.get(f"/records/{name}", Authorization=BEARER)[0] == 404


def test_link_out_of_the_folder_is_not_followed(arm: Arm, tmp_path: Path) -> None:
    name = "20260101-130000.mcap"
    (arm.records / name).symlink_to(tmp_path / "secret.mcap")
    assert arm.get(f"/records/{name}", Authorization=BEARER)[0] == 404
    assert name not in [each["name"] for each in listed(arm)]


def test_other_origin_gets_no_record(arm: Arm) -> None:
    headers = {"Authorization": BEARER, "Origin": "http://evil.example"}
    assert arm.get(f"/records/{STOP}", **headers)[0] == 403


def test_only_the_newest_records_are_listed(arm: Arm) -> None:
    for number in range(records.MOST + 10):
        (arm.records / f"20260102-12{number // 60:02}{number % 60:02}.mcap").touch()
    os.utime(arm.records / WHOLE, (0, 0))
    names = [each["name"] for each in listed(arm)]
    assert len(names) == records.MOST
    assert WHOLE not in names


def test_without_records_nothing_is_listed(arm: Arm) -> None:
    for path in arm.records.iterdir():
        path.unlink()
    assert listed(arm) == []
    arm.records.rmdir()
    assert listed(arm) == []
