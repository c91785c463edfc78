"""What the monkey says of a file that is no record."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.chaos.__main__ import main
from deploy.chaos.history import Life
from deploy.chaos.record import PROCESSES, Recorder


def recorded(path: Path) -> bytes:
    """A record of a process, and nothing else."""
    recorder = Recorder(path, 0, 0)
    recorder.event(PROCESSES, 1, Life("kinematics", 7, 0.0, None)._asdict() | {"namespace": "/"})
    recorder.close()
    return path.read_bytes()


@pytest.mark.parametrize("kept", [0, 5, 100, -10], ids="to {} bytes".format)
def test_tells_in_a_line_that_a_record_is_not_complete(
    kept: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = tmp_path / "record.mcap"
    record.write_bytes(recorded(tmp_path / "whole.mcap")[:kept])
    assert main(["--replay", str(record)]) == 1
    assert capsys.readouterr().err.startswith(f"{record} is no complete record: ")


def test_tells_in_a_line_that_a_file_is_no_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = tmp_path / "letter.txt"
    record.write_text("Dear monkey,\nplease stop.\n")
    assert main(["--replay", str(record)]) == 1
    assert capsys.readouterr().err.startswith(f"{record} is no complete record: ")
