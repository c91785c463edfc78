"""The ring keeps the last minutes, and what surrounds each stop, on a bounded disk.

Time is that of the messages.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest
from mcap_files import McapFile
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from deploy.supervision import ring
from deploy.supervision.ring import RING, Ring
from deploy.supervision.run_directory import STOP_RECORD

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND
MINUTES = 10
TICK, STATE = "/tick", "/engines/state"


class Arm:
    """Sends a message with its time each second, and the state of the engines when it changes."""

    def __init__(self, folder: Path, begin: int = 0) -> None:
        self.folder, self.now = folder, begin
        self.ring = Ring(folder, MINUTES, {STATE}, begin * SECOND, EPOCH + begin * SECOND)

    def send(self, topic: str, text: str) -> None:
        at = self.now * SECOND
        self.ring.message(topic, "std_msgs/msg/String", "", serialize_message(String(data=text)), at, at)

    def run(self, seconds: int) -> None:
        for _ in range(seconds):
            self.send(TICK, str(self.now))
            self.now += 1

    def stop(self) -> None:
        self.send(STATE, "off")
        self.ring.stop(self.now * SECOND)

    @property
    def last_minutes(self) -> list[Path]:
        return sorted((self.folder / RING).iterdir())

    @property
    def stops(self) -> list[Path]:
        return sorted(self.folder.glob(f"{STOP_RECORD}*"))


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[Arm]:
    arm = Arm(tmp_path)
    yield arm
    arm.ring.close()


def texts(path: Path, topic: str = TICK) -> list[str]:
    with McapFile(path) as file:
        messages = [(message.log_time, message.data) for _, message in file.messages({topic})]
    return [data[8:].rstrip(b"\0").decode() for _, data in sorted(messages)]


def seconds(*paths: Path) -> list[int]:
    return [int(text) for path in paths for text in texts(path)]


def test_ring_keeps_the_last_minutes(arm: Arm) -> None:
    arm.run(3600)
    arm.ring.close()
    kept = seconds(*arm.last_minutes)
    assert kept == list(range(kept[0], 3600))
    assert MINUTES * 60 <= len(kept) <= (MINUTES + 1) * 60
    assert len(arm.last_minutes) == MINUTES + 1
    assert not arm.stops


def test_what_surrounds_a_stop_survives_the_ring(arm: Arm) -> None:
    arm.run(1000)
    arm.stop()
    arm.run(7200)
    (stop,) = arm.stops
    assert seconds(stop) == list(range(970, 1010))
    with McapFile(stop) as file:
        assert file.is_complete
    assert stop.name[len(STOP_RECORD) :] < arm.last_minutes[0].name


@pytest.mark.parametrize("early", [0, 3, 29])
def test_a_stop_soon_after_the_begin_keeps_what_there_was(arm: Arm, early: int) -> None:
    arm.run(early)
    arm.stop()
    arm.run(60)
    assert seconds(*arm.stops) == list(range(early + 10))


def test_two_stops_close_to_each_other_are_in_one_record(arm: Arm) -> None:
    arm.run(100)
    arm.stop()
    arm.run(8)
    arm.stop()
    arm.run(100)
    assert seconds(*arm.stops) == list(range(70, 118))


def test_a_stop_is_on_the_disk_before_its_record_ends(arm: Arm) -> None:
    """The recorder may be killed together with the engines."""
    arm.run(100)
    arm.stop()
    (stop,) = arm.stops
    assert seconds(stop) == list(range(70, 100))
    assert texts(stop, STATE) == ["off"]


def test_each_record_begins_with_the_latched_messages(arm: Arm) -> None:
    arm.send(STATE, "on")
    arm.run(230)
    arm.stop()
    arm.run(60)
    arm.ring.close()
    assert [texts(path, STATE) for path in arm.last_minutes] == [
        ["on"],
        ["on"],
        ["on"],
        ["on", "off"],
        ["off"],
    ]
    assert texts(*arm.stops, STATE) == ["on", "off"]
    for path in (*arm.last_minutes, *arm.stops):
        with McapFile(path) as file:
            assert file.end - file.start <= ring.PART


def test_only_the_newest_stops_are_kept(arm: Arm) -> None:
    for number in range(ring.MOST_STOPS + 5):
        arm.run(20)
        arm.stop()
        assert len(arm.stops) == min(number + 1, ring.MOST_STOPS)
    assert 20 * (ring.MOST_STOPS + 5) - 1 in seconds(arm.stops[-1])


def test_flood_takes_a_bounded_disk(arm: Arm, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ring, "LARGEST", 100_000)
    random = Random(7)
    for second in range(60):
        for _ in range(50):
            at = arm.now * SECOND
            arm.ring.message("/flood", "std_msgs/msg/String", "", random.randbytes(1000), at, at)
            arm.ring.save()
        arm.run(1)
        if second == 30:
            arm.stop()
    arm.ring.close()
    files = [*arm.last_minutes, *arm.stops]
    assert len(arm.last_minutes) == MINUTES + 1
    assert max(path.stat().st_size for path in files) < 120_000  # with its end
    assert seconds(*arm.last_minutes)[-1] == 59
    assert seconds(*arm.stops)


def test_records_of_an_earlier_run_count(arm: Arm) -> None:
    arm.run(3600)
    arm.ring.close()
    again = Arm(arm.folder, begin=7200)
    again.run(130)
    again.ring.close()
    assert len(again.last_minutes) == MINUTES + 1
    assert seconds(*again.last_minutes[-3:]) == list(range(7200, 7330))
