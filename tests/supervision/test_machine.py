from __future__ import annotations

import math
import shutil
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from deploy.supervision.machine import FLOOD, Figures, Machine, datagrams, figures
from interfaces.loopback import LOOPBACK_DOWN

PERIOD = 0.5
DISK = "less than 200 MB are free for /run: a full disk loses logs and records"
FLOODED = (
    "more than 10000 UDP datagrams arrive each second, or more than 100 find no room:"
    " discovery and messages are late"
)
OVERLOAD = "timers come more than 50 ms late: the processor has too much to do"


class Looks:
    """Looks at a machine on which all is well, except for what the test changes."""

    def __init__(self) -> None:
        self.machine = Machine(Path("/run"), PERIOD)
        self.disk_free = 1e9
        self.loopback_is_up = True
        self.now = 1000.0
        self.clock_error = 0.0
        self.rates = (0, 0)  # datagrams a second that arrive, and that are lost
        self.datagrams = [5_000_000, 70_000]

    def look(
        self, times: int = 1, *, late: float = 0.0, pauses: tuple[float, float] = (0.0, 0.0)
    ) -> dict[str, str]:
        """Return the warnings of the last look; each comes late by ``late`` and pauses for ``pauses`` [s]."""
        for _ in range(times):
            before = self.now + PERIOD + late
            read = before + pauses[0]
            after = read + pauses[1]
            time_of_day = 1.7e9 + read + self.clock_error
            passed, self.now = before - self.now, before
            self.datagrams = [
                count + round(rate * passed) for count, rate in zip(self.datagrams, self.rates, strict=True)
            ]
            clocks = before, time_of_day, after
            seen = Figures(self.disk_free, self.loopback_is_up, *clocks, *self.datagrams)
            warnings = self.machine.warnings(seen)
        return warnings


@pytest.fixture
def looks() -> Looks:
    looks = Looks()
    assert looks.look(2) == {}
    return looks


def test_a_nearly_full_disk_is_a_warning_until_there_is_enough_again(looks: Looks) -> None:
    for free, warnings in (
        (200e6, {}),
        (199e6, {"disk": DISK}),
        (299e6, {"disk": DISK}),  # at the limit, it does not come and go
        (300e6, {}),
        (201e6, {}),
    ):
        looks.disk_free = free
        assert looks.look() == warnings


@pytest.mark.parametrize(("step", "way"), [(3.2, "forward by 3.20 s"), (-0.06, "back by 0.06 s")])
def test_a_step_of_the_time_of_day_is_a_warning_for_a_minute(looks: Looks, step: float, way: str) -> None:
    looks.clock_error = step
    assert looks.look()["clock"] == (
        f"the time of day was set {way}: heartbeats and presences may count as old;"
        " NTP or PTP keeps it steady"
    )
    assert looks.look(119).keys() == {"clock"}
    assert looks.look() == {}


def test_a_clock_that_is_slewed_or_read_late_was_not_set(looks: Looks) -> None:
    for _ in range(100):
        looks.clock_error += 0.0005  # NTP slews at most so fast
        assert looks.look() == {}
    for pauses in ((0.1, 0.0), (0.0, 0.1)):
        assert looks.look(pauses=pauses) == {}
        assert looks.look() == {}


def test_a_loopback_interface_that_is_down_is_a_warning(looks: Looks) -> None:
    looks.loopback_is_up = False
    assert looks.look() == {"loopback": LOOPBACK_DOWN}
    looks.loopback_is_up = True
    assert looks.look() == {}


@pytest.mark.parametrize(
    ("rates", "is_flood"),
    [((9_990, 98), False), ((10_010, 0), True), ((200, 104), True), ((0, 0), False)],
)
def test_many_datagrams_or_lost_ones_for_five_seconds_are_a_flood(
    looks: Looks, rates: tuple[int, int], is_flood: bool
) -> None:
    looks.rates = rates
    assert looks.look(9) == {}
    assert looks.look() == ({FLOOD: FLOODED} if is_flood else {})


def test_burst_of_a_start_is_no_flood(looks: Looks) -> None:
    looks.rates = (13_000, 0)
    assert looks.look(4) == {}
    looks.rates = (2_000, 0)
    assert looks.look(20) == {}


def test_a_great_flood_is_known_soon_and_ends_with_its_window(looks: Looks) -> None:
    looks.rates = (100_000, 0)
    assert looks.look(1) == {}
    assert looks.look(1) == {FLOOD: FLOODED}
    looks.rates = (0, 0)
    assert looks.look(8) == {FLOOD: FLOODED}
    assert looks.look() == {}


def test_datagrams_to_this_kernel_are_counted() -> None:
    before = datagrams()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        receiver.bind(("127.0.0.1", 0))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for _ in range(200):
                sender.sendto(bytes(1000), receiver.getsockname())
    after = datagrams()
    assert after[0] - before[0] >= 150
    assert after[1] - before[1] >= 100


def test_three_late_looks_within_ten_seconds_are_an_overload_until_none_is_late(looks: Looks) -> None:
    assert looks.look(2, late=0.06) == {}
    assert looks.look(21) == {}
    assert looks.look(2, late=0.06) == {}
    assert looks.look(1, late=0.06) == {"overload": OVERLOAD}
    assert looks.look(19) == {"overload": OVERLOAD}
    assert looks.look() == {}
    assert looks.look(40, late=0.04) == {}


def test_a_look_after_one_that_waited_for_supervisord_is_not_late(looks: Looks) -> None:
    for _ in range(10):
        looks.machine.skip()
        assert looks.look(late=1.5) == {}


def test_figures_are_those_of_the_kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=len(str(path))))
    seen = figures(tmp_path)
    assert seen.disk_free == len(str(tmp_path))
    assert seen.loopback_is_up
    assert seen.before <= seen.after < seen.time_of_day


def test_a_run_directory_that_is_gone_has_no_full_disk(tmp_path: Path) -> None:
    assert figures(tmp_path / "gone").disk_free == math.inf


def test_a_new_network_namespace_has_its_loopback_down() -> None:
    code = "from interfaces.loopback import loopback_is_up; print(loopback_is_up())"
    unshare = ["unshare", "--net", "--map-root-user", sys.executable, "-c", code]
    done = subprocess.run(unshare, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False)
    if done.stderr.startswith("unshare:"):
        pytest.skip(f"platform: {done.stderr}")
    assert done.stdout == "False\n"
