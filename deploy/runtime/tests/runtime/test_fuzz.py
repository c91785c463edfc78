"""Damaged input is refused or read as a valid value; `.ci/run` feeds each decoder a million."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from .fuzz import NAMES, feed

PROGRAM = Path(__file__).with_name("fuzz.py")

PLANTED = """
import sys
sys.path.insert(0, {directory!r})
import fuzz
from rclpy import _discovery_info

kept = []

def read(data):
    {fault}
    return _discovery_info.decode(data)

good = fuzz.decoder(fuzz.DISCOVERY)
planted = good._replace(read=read)
fuzz.limit_memory()
fuzz.decoder = lambda name: planted
fuzz.feed(fuzz.DISCOVERY, {inputs}, "")
"""


@pytest.mark.parametrize("name", NAMES)
def test_damaged_input_is_refused_or_read_as_a_valid_value(name: str) -> None:
    accepted, refused = feed(name, 3000, "")
    assert accepted
    assert refused or name == "a parameter's value"  # any text is one


def test_program_feeds_every_decoder_in_batches() -> None:
    run = subprocess.run(
        [sys.executable, str(PROGRAM), "300"],
        env=os.environ | {"FUZZ_SEED": "7"},
        capture_output=True,
        text=True,
        check=True,
    )
    first, *lines = run.stdout.splitlines()
    assert first == "FUZZ_SEED=7"
    assert [line.partition(": ")[0] for line in lines] == NAMES


@pytest.mark.parametrize(
    ("fault", "inputs"),
    [
        ("bytearray(max(0, int.from_bytes(data[20:24], 'little')))", 2000),  # trusts a count
        ("kept.append(bytearray(1 << 20))", 100),  # leaks 1 MB
        ("kept.append(bytearray(2000))", 50_000),
        ("kept.extend([[each] for each in range(40)])", 50_000),  # leaves no memory for the report
        ("data[1000]", 10),  # another error than ValueError
    ],
)
def test_fault_of_a_decoder_is_found(fault: str, inputs: int) -> None:
    program = PLANTED.format(directory=str(PROGRAM.parent), fault=fault, inputs=inputs)
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert run.returncode != 0
    assert "AssertionError: ros_discovery_info: " in run.stderr
