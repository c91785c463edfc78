"""The same seed gives the same run, byte for byte."""

from __future__ import annotations

import os
import subprocess
import sys

from tests.simulation_kit.tests import busy


def test_a_seed_gives_the_same_run_in_each_interpreter() -> None:
    def digests(hash_seed: str) -> list[str]:
        environment = os.environ | {"PYTHONHASHSEED": hash_seed}
        command = [sys.executable, "-m", busy.__name__]
        return subprocess.run(
            command, env=environment, capture_output=True, text=True, check=True
        ).stdout.split()

    one, other = digests("1"), digests("2")
    assert one == other
    assert one[0] != one[1]
    assert busy.digest(7) == one[0]
