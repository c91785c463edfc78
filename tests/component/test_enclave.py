"""The keys with which a process joins: how long they are valid, and what their process reports of that."""

from __future__ import annotations

import socket
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from interfaces.service import ServiceNode, UserError, enclave
from interfaces.service.enclave import Keys
from interfaces.service.health import heard_healths
from reactive_node.testing import MakeNode, SpinUntil

BEGIN, END = datetime(2026, 11, 1, tzinfo=UTC), datetime(2036, 10, 29, 12, 30, tzinfo=UTC)
KEYS = Keys("/velocity", BEGIN, END)
RENEW = "make keystore, then make stop and start"


@pytest.fixture
def permissions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The permissions of /arm1/velocity; the environment wants security."""
    path = tmp_path / "enclaves" / "arm1" / "velocity" / "permissions.p7s"
    path.parent.mkdir(parents=True)
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    monkeypatch.setenv("ROS_SECURITY_KEYSTORE", str(tmp_path))
    return path


def write(path: Path, begin: datetime, end: datetime) -> None:
    times = (time.isoformat() for time in (begin, end))
    path.write_text("a\r\n<not_before>{}</not_before>\r\n<not_after>{}</not_after>".format(*times))


@pytest.mark.parametrize("zone", ["", "Z", "+00:00"])
def test_validity_is_that_of_the_permissions(zone: str, permissions: Path) -> None:
    begin, end = (time.replace(tzinfo=None).isoformat() + zone for time in (BEGIN, END))
    permissions.write_text(f"<not_before>{begin}</not_before>\n <not_after>{end}</not_after>")
    assert enclave.keys("/arm1/velocity") == Keys("/arm1/velocity", BEGIN, END)


@pytest.mark.parametrize("content", [None, b"", b"\xff\xfe", b"<not_before>x</not_before><not_after/>"])
def test_permissions_without_times_are_left_to_rclpy(content: bytes | None, permissions: Path) -> None:
    if content is not None:
        permissions.write_bytes(content)
    assert enclave.keys("/arm1/velocity") is None
    assert enclave.arguments("velocity", "/arm1") == ["--ros-args", "--enclave", "/arm1/velocity"]


def test_nobody_joins_before_or_after_the_validity() -> None:
    second = timedelta(seconds=1)
    assert KEYS.problem(BEGIN) == KEYS.problem(END - second) == ""
    assert KEYS.problem(END) == f"the keys of /velocity have ended at 2036-10-29 12:30 UTC: {RENEW}"
    assert KEYS.problem(BEGIN - second) == (
        "the keys of /velocity begin at 2026-11-01 00:00 UTC,"
        " and this host's clock says 2026-10-31 23:59: set it"
    )


@pytest.mark.parametrize(
    ("left", "amount"),
    [
        (timedelta(days=13, hours=23), "13 days"),
        (timedelta(days=3), "3 days"),
        (timedelta(hours=47, minutes=59), "47 hours"),
        (timedelta(minutes=5), "0 hours"),
    ],
)
def test_end_of_the_keys_is_reported_two_weeks_before(left: timedelta, amount: str) -> None:
    assert KEYS.warning(END - left) == f"they end in {amount}, and the arm with them: {RENEW}"
    assert KEYS.warning(END - timedelta(days=14)) == ""


def test_keys_that_have_ended_are_refused_before_the_process_joins(permissions: Path) -> None:
    now = datetime.now(UTC)
    write(permissions, now - timedelta(days=2), now - timedelta(days=1))
    with pytest.raises(UserError, match=r"^the keys of /arm1/velocity have ended at "):
        enclave.arguments("velocity", "/arm1")


def test_each_report_warns_of_the_end_of_its_keys(make_node: MakeNode, spin_until: SpinUntil) -> None:
    service, watching = make_node("velocity", kind=ServiceNode), make_node("watching")
    now = datetime.now(UTC)
    service.health.keys = Keys("/velocity", now, now + timedelta(days=3, hours=1))
    with heard_healths(watching) as health:
        velocity = socket.gethostname(), "velocity"
        spin_until(lambda: velocity in health)  # the first report, too
        assert health[velocity].reason == f"keys: they end in 3 days, and the arm with them: {RENEW}"


def test_service_ends_with_its_keys(make_node: MakeNode) -> None:
    service, now, hour = make_node("velocity", kind=ServiceNode), datetime.now(UTC), timedelta(hours=1)
    service.health.keys = Keys("/velocity", now - hour, now + hour)
    service.health.on_period()
    service.health.keys = Keys("/velocity", now - hour, now)
    with pytest.raises(UserError, match=r"^the keys of /velocity have ended at "):
        service.health.on_period()
