"""The same seed gives the same run, byte for byte."""

from __future__ import annotations

import os
import subprocess
import sys

from tests.simulation_kit.tests import busy

RECORDED = "e4237b01f003cc9551fbe4edc65c58ae90ed4e16770053839dc4b151f9e408fa"
"""The digest of seed 7 on each Python and release of ROS 2. A change of the model changes it."""


def test_a_seed_gives_the_recorded_run_in_each_interpreter() -> None:
    def digests(hash_seed: str) -> list[str]:
        environment = os.environ | {"PYTHONHASHSEED": hash_seed}
        command = [sys.executable, "-m", busy.__name__]
        return subprocess.run(
            command, env=environment, capture_output=True, text=True, check=True
        ).stdout.split()

    one, other = digests("1"), digests("2")
    assert one == other
    assert one[0] == busy.digest(7) == RECORDED
    assert one[0] != one[1]
