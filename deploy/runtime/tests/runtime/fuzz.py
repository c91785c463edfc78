"""Damaged input for each decoder of untrusted bytes: it is refused with ValueError, or read as a valid value.

``python deploy/runtime/tests/runtime/fuzz.py 1000000`` feeds each decoder that many inputs: in batches, on
all processors, and with a limit on the memory that a process may allocate. FUZZ_SEED repeats a run.
"""

from __future__ import annotations

import math
import os
import random
import resource
import struct
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from rclpy._discovery_info import NodeEntities, decode, encode
from rclpy._parameter_scalars import plain_scalar
from rosidl_runtime_embedded import message_class
from rosidl_runtime_embedded.definition_files import message_definition
from rosidl_runtime_embedded.fields import ARRAY_CODES

MAIN_TYPES = [
    "std_msgs/msg/Float64",
    "std_msgs/msg/Bool",
    "std_msgs/msg/String",
    "std_msgs/msg/Header",
    "geometry_msgs/msg/PointStamped",
    "diagnostic_msgs/msg/DiagnosticArray",
    "rcl_interfaces/msg/ParameterEvent",
    "rcl_interfaces/srv/SetParameters_Request",
    "rmw_dds_common/msg/ParticipantEntitiesInfo",
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/Image",
    "nav_msgs/msg/Odometry",
    "visualization_msgs/msg/InteractiveMarker",
    "type_description_interfaces/srv/GetTypeDescription_Response",
]
DISCOVERY, SCALAR = "ros_discovery_info", "a parameter's value"
NAMES = [*MAIN_TYPES, DISCOVERY, SCALAR]

BATCH = 50_000  # inputs
MEMORY = 64 << 20  # bytes that a process may allocate in addition to what it has when the first batch begins
ADDRESSES = resource.getrlimit(resource.RLIMIT_AS)  # made now: without memory, nothing can be made


class Decoder(NamedTuple):
    read: Callable[[bytes], Any]
    """Raises ValueError, and nothing else, for malformed input."""
    samples: list[bytes]
    """Good inputs, from which the damaged ones are made."""
    check: Callable[[Any], None]
    """Asserts that what the decoder has read is valid."""


@cache
def decoder(name: str) -> Decoder:
    """Return the decoder with one of :data:`NAMES`, or of any message type."""
    if name == DISCOVERY:
        return _discovery()
    if name == SCALAR:
        texts = ("-0x7F", "017", "1.5e-3", "+.inf", ".nan", "off", "Yes", "text", "9223372036854775807")
        return Decoder(
            lambda data: plain_scalar(data.decode("latin-1")), [t.encode() for t in texts], _is_scalar
        )
    cls: Any = message_class(name)

    def read(data: bytes) -> Any:
        return cls._deserialize(memoryview(data) if len(data) & 1 else data)  # large samples are lent

    def is_written_as_it_is_read(message: Any) -> None:
        written = cls._serialize(message)
        assert cls._serialize(cls._deserialize(written)) == written

    samples = [cls._serialize(cls()), cls._serialize(populated(name))]
    return Decoder(read, samples, is_written_as_it_is_read)


def _discovery() -> Decoder:
    node = NodeEntities("/namespace", "node")
    node.readers, node.writers = [bytes(16)] * 3, [bytes(range(16))]
    samples = [encode(bytes(16), []), encode(bytes(16), [node]), encode(bytes(range(16)), [node] * 3)]

    def is_written_as_it_is_read(info: tuple[bytes, list[NodeEntities]]) -> None:
        written = encode(*info)
        assert encode(*decode(written)) == written

    return Decoder(decode, samples, is_written_as_it_is_read)


def _is_scalar(value: Any) -> None:
    assert type(value) in (bool, int, float, str)
    assert type(value) is not int or -(2**63) <= value < 2**63


def populated(name: str) -> Any:
    """A message whose sequences and strings are not empty."""
    values: dict[str, Any] = {}
    for field in message_definition(name).fields:
        type_ = field.type
        if type_.is_message:
            value: Any = populated(type_.base)
        elif type_.base in ("string", "wstring"):
            value = "text"[: type_.string_bound or 4]
        elif type_.base in ARRAY_CODES:
            value = 1.5 if type_.base in ("float", "double") else 1
        else:
            value = True if type_.base == "boolean" else b"\1"
        if type_.is_plural:
            value = [value] * (type_.array_size or min(type_.sequence_bound or 2, 2))
        values[field.name] = value
    return message_class(name)(**values)


def damaged(sample: bytes, chance: random.Random) -> bytes:
    """A sample with random damage to bits, bytes, counts or length, or noise behind a valid header."""

    def below(limit: int) -> int:  # several times as fast as randrange
        return int(chance.random() * limit)

    data = bytearray(sample)
    kind = below(5)
    if kind == 0:
        return sample[:4] + chance.randbytes(below(2 * len(sample)))
    for _ in range(1 + below(4)):
        position = below(len(data))
        if kind == 1:
            data[position] ^= 1 << below(8)
        elif kind == 2:
            data[position] = (0, 1, 2, 0x7F, 0x80, 0xFF, below(256))[below(7)]
        elif kind == 3:
            position = min(position & ~3, max(0, len(data) - 4))
            data[position : position + 4] = COUNTS[below(len(COUNTS))]
        elif below(2):
            del data[position : position + 1 + below(8)]
            data = data or bytearray(1)
        else:
            data[position:position] = chance.randbytes(1 + below(8))
    return bytes(data)


COUNTS = [struct.pack("<I", count) for count in (0, 1, 2, 3, 255, 65536, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)]


def feed(name: str, inputs: int, seed: str) -> tuple[int, int]:
    """Return how many damaged inputs a decoder reads and refuses. Raises AssertionError with any other."""
    read, samples, check = decoder(name)
    chance = random.Random(f"{name} {seed}")
    accepted = 0
    for _ in range(inputs):
        data = damaged(samples[int(chance.random() * len(samples))], chance)
        try:
            value = read(data)
        except ValueError:
            continue
        except Exception as error:
            resource.setrlimit(resource.RLIMIT_AS, ADDRESSES)  # the report needs memory
            raise AssertionError(f"{name}: {error!r} for {data.hex()}") from error
        accepted += 1
        if accepted % 10 == 0:
            try:
                check(value)
            except Exception as error:
                resource.setrlimit(resource.RLIMIT_AS, ADDRESSES)
                raise AssertionError(f"{name}: {error!r} after reading {data.hex()}") from error
    return accepted, inputs - accepted


def limit_memory() -> None:
    """Make an allocation fail that exceeds the memory of this process by more than :data:`MEMORY`."""
    for name in NAMES:
        feed(name, 100, "")  # imports and caches
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, ADDRESSES[1]))


def main() -> None:
    """Feed each decoder; exit code 1 after the first error."""
    inputs = int(sys.argv[1])
    seed = os.environ.get("FUZZ_SEED") or str(time.time_ns())
    print(f"FUZZ_SEED={seed}", flush=True)
    batches = math.ceil(inputs / BATCH)
    with ProcessPoolExecutor(initializer=limit_memory) as processes:
        results = {
            name: [
                processes.submit(feed, name, min(BATCH, inputs - BATCH * batch), f"{seed} {batch}")
                for batch in range(batches)
            ]
            for name in NAMES
        }
        try:
            for name, parts in results.items():
                accepted, refused = (
                    sum(numbers) for numbers in zip(*(part.result() for part in parts), strict=True)
                )
                print(f"{name}: {accepted} read, {refused} refused", flush=True)
        except AssertionError as error:
            processes.shutdown(cancel_futures=True)
            sys.exit(str(error))


if __name__ == "__main__":
    main()
