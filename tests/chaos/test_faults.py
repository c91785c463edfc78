"""What the monkey does where its victim is not as it expects."""

from __future__ import annotations

import resource
from pathlib import Path

import pytest
import yaml

from deploy.chaos.faults import FAULTS
from deploy.chaos.history import NOTHING
from deploy.system import System


class Nobody:
    """An arm of which no process lives."""

    namespace = "/arm1"

    def __init__(self, run: Path) -> None:
        self.system = System(run)

    def pid(self, program: str) -> int:
        return 0

    def environment(self) -> dict[str, str]:
        return {}


@pytest.fixture
def nobody(tmp_path: Path) -> Nobody:
    return Nobody(tmp_path)


def test_a_full_disk_without_supervisord_is_nobodys(nobody: Nobody) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    undo = FAULTS["full_disk"].do(nobody, NOTHING)
    assert resource.getrlimit(resource.RLIMIT_FSIZE) == before
    assert undo is not None
    undo()
    assert resource.getrlimit(resource.RLIMIT_FSIZE) == before


def test_a_double_of_what_has_ended_is_none(nobody: Nobody) -> None:
    undo = FAULTS["double"].do(nobody, "sentinel")
    assert undo is not None
    undo()


def test_two_crash_loops_at_a_time_leave_the_good_parameters(nobody: Nobody) -> None:
    good = {"/**": {"ros__parameters": {"scenario": "demo"}}}
    nobody.system.parameters.write_text(yaml.safe_dump(good))
    first = FAULTS["crash_loop"].do(nobody, "config_l1")
    second = FAULTS["crash_loop"].do(nobody, "sentinel")
    during = yaml.safe_load(nobody.system.parameters.read_text())
    assert during.keys() == {"/**", "/arm1/config_l1", "/arm1/sentinel"}
    assert first is not None
    assert second is not None
    first()
    second()
    assert yaml.safe_load(nobody.system.parameters.read_text()) == good
