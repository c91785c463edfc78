"""The testbed waits for its arms: their sources are silent until the origin of the scenario."""

from __future__ import annotations

import os
import queue
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from deploy.supervision.errors import DeploymentError
from tests.chaos.testbed import START_TIMEOUT, Testbed
from tests.promises.history import OUTPUTS

ARMS = tuple(f"/arm{number}" for number in range(1, 31))


class Observer:
    """In place of the lines of the observer: it sees each topic from a time on [s], and time passes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, lines: list[str], since: float) -> None:
        self.now = 0.0
        self._lines = lines
        self._since = since
        monkeypatch.setattr(time, "monotonic", lambda: self.now)

    def get(self, timeout: float) -> str:
        self.now += timeout
        if self.now < self._since or not self._lines:
            raise queue.Empty
        return self._lines.pop()


@pytest.fixture
def fleet(tmp_path: Path) -> Any:
    testbed: Any = Testbed(tmp_path / "fleet", ARMS)
    testbed.epoch = testbed.lead
    assert testbed.lead > START_TIMEOUT, "a fleet starts longer than an arm may be silent"
    return testbed


def seen(names: list[str]) -> list[str]:
    return [f"seen {name}/{topic.name}" for name in names for topic in OUTPUTS.values()]


def test_waits_for_the_output_of_all_arms_until_after_the_origin(
    fleet: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = seen(list(ARMS))
    fleet.await_messages(fleet.arms, list(OUTPUTS.values()), Observer(monkeypatch, lines, fleet.lead))
    assert not lines


def test_names_the_topics_without_a_message(fleet: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    observer = Observer(monkeypatch, seen([*ARMS[1:]]), fleet.lead)
    with pytest.raises(DeploymentError) as error:
        fleet.await_messages(fleet.arms, list(OUTPUTS.values()), observer)
    topics = "/arm1/driven_time, /arm1/effector/position, /arm1/effector/speed and 8 more topics"
    assert str(error.value) == f"No message on {topics} within 60 s: try fewer --arms"
    assert observer.now == pytest.approx(fleet.lead + START_TIMEOUT, abs=1.0)


def test_topics_that_were_seen_before_are_not_awaited(fleet: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    observer = Observer(monkeypatch, seen([ARMS[0]]), 1.0)
    fleet.await_messages(fleet.arms[:1], list(OUTPUTS.values()), observer)
    fleet.await_messages(fleet.arms[:1], list(OUTPUTS.values()), observer)
    assert observer.now < 10.0


def test_observer_that_cannot_join_is_reported(tmp_path: Path) -> None:
    done = subprocess.run(
        ["unshare", "--net", "--map-root-user", sys.executable, "-m", "tests.chaos"],
        env={**os.environ, "REACTIVE_ARM_RUN_DIR": str(tmp_path / "run")},
        capture_output=True,
        text=True,
        timeout=60,
    )
    if done.stderr.startswith("unshare:"):
        pytest.skip(f"platform: {done.stderr}")
    assert done.returncode == 1
    reason = r"The observer cannot join the ROS graph: .* is down.*\nThe observer has ended\n"
    assert re.fullmatch(reason, done.stderr)
