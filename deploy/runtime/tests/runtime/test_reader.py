from __future__ import annotations

import tracemalloc
from types import SimpleNamespace
from typing import Any

import pytest

from rclpy._dds import INFINITY, Participant, Reader, WaitSet, Writer, entities
from rclpy.qos import QoSProfile

HEADER = b"\x00\x01\x00\x00"
PROFILE = QoSProfile(depth=10)


@pytest.fixture
def writer(participant: Participant) -> Writer:
    return participant.create_writer("rt/x", "Octets_", PROFILE, "")


@pytest.fixture
def reader(participant: Participant) -> Reader:
    return participant.create_reader("rt/x", "Octets_", PROFILE, "")


def wait(reader: Reader) -> None:
    waitset = WaitSet()
    waitset.attach(reader.condition, 0)
    waitset.wait(INFINITY)
    waitset.close()


class Octets(bytes):
    """Octets of a user's own class."""


@pytest.mark.parametrize("cls", [bytes, Octets])
def test_messages_of_all_sizes_arrive_unchanged(cls: type[bytes], reader: Reader, writer: Writer) -> None:
    for size in (1, 2, 3, 4, 5, 8, 5, 4, 63, 64, 65, 1000, 100_000):
        message = cls(HEADER + bytes(number % 251 for number in range(1, size + 1)))
        writer.write(message)
        wait(reader)
        sample = reader.take()
        assert sample is not None
        assert sample.data == message + bytes(-size % 4)  # RTPS pads to four octets


def test_a_take_during_a_take_gets_the_next_message(
    reader: Reader, writer: Writer, monkeypatch: pytest.MonkeyPatch
) -> None:
    quick = entities.quick
    taken: list[bytes] = []

    def take(*arguments: Any) -> int:
        count = int(quick.dds_takecdr(*arguments))
        if not taken:  # another thread may run here
            taken.append(b"")
            sample = reader.take()
            assert sample is not None
            taken.append(sample.data)
        return count

    for message in (b"1111", b"2222"):
        writer.write(HEADER + message)
        wait(reader)
    names = ("ddsi_serdata_size", "ddsi_serdata_to_ser", "ddsi_serdata_unref")
    functions = {name: getattr(quick, name) for name in names}
    monkeypatch.setattr(entities, "quick", SimpleNamespace(dds_takecdr=take, **functions))
    sample = reader.take()
    assert sample is not None
    assert sample.data == HEADER + b"1111"
    assert taken[1:] == [HEADER + b"2222"]
    assert reader.take() is None


def test_a_big_message_leaves_no_memory_allocated(reader: Reader, writer: Writer) -> None:
    writer.write(HEADER + bytes(10_000_000))
    wait(reader)
    tracemalloc.start()
    try:
        sample = reader.take()
        assert sample is not None
        assert len(sample.data) == 10_000_004
        del sample
        size, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak > 10_000_000
    assert size < 100_000
