"""The line that shows the state of an arm."""

from __future__ import annotations

import time
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from reactivex import Observable
from reactivex.subject import Subject
from std_msgs.msg import Header

from deploy.operator.state_line import Shown, parts, shown, text
from interfaces import topics


class Arm:
    def __init__(self) -> None:
        self.now = time.monotonic()  # by which reports of health are heard
        self.said: dict[str, Subject[Any]] = {topic.name: Subject() for topic in topics.CONTRACT}
        self.watchdogs: Subject[bool] = Subject()
        self.states: list[Shown] = []
        shown("/arm", self._seen, self.watchdogs, lambda: self.now).subscribe(self.states.append)

    def _seen(self, topic: topics.Topic) -> Observable[Any]:
        return self.said[topic.name]

    def say(self, topic: topics.Topic, *messages: Any) -> None:
        for message in messages:
            self.said[topic.name].on_next(message)

    def report(self, *names: str, level: bytes = DiagnosticStatus.OK, **values: str) -> None:
        given = {"pid": "7", "published": "1", "seconds_since_output": "0.1"}
        pairs = [KeyValue(key=key.replace("_", " ", 1), value=it) for key, it in values.items()]
        pairs += [KeyValue(key=key, value=value) for key, value in given.items()]
        status = [DiagnosticStatus(name=f"/arm/{name}", level=level, values=pairs) for name in names]
        self.say(topics.DIAGNOSTICS, DiagnosticArray(status=status))

    def line(self, width: int = 1000) -> str:
        return text(parts(self.states[-1], self.now, width))


@pytest.fixture
def arm() -> Arm:
    arm = Arm()
    arm.watchdogs.on_next(True)
    arm.say(topics.ENGINES_STATE, topics.ON)
    arm.say(topics.OPERATOR_HAND, Header(frame_id="terminal_7"))
    arm.say(topics.OPERATOR_HEARTBEAT, True)
    arm.report("kinematics", "motion")
    return arm


def test_line_tells_engines_hand_strikes_health_and_bound(arm: Arm) -> None:
    words = "Engines on · Held by terminal · 3 strikes left · 2 of 2 ok · off within 10.5 s"
    assert arm.line() == words
    assert len(words) < 80
    assert arm.line(60) == "Engines on · Held by terminal · 3 strikes left · 2 of 2 ok"


def test_what_is_old_is_not_shown_as_fresh(arm: Arm) -> None:
    arm.now += 0.6
    assert arm.line(40) == "Engines: unknown · Released"
    arm.now += 3.0
    assert "0 of 2 ok (kinematics, motion)" in arm.line()


def test_strikes_count_down_and_begin_again(arm: Arm) -> None:
    arm.say(topics.OPERATOR_ACTIVITY, topics.MISSED, topics.MISSED)
    assert "1 strike left" in arm.line()
    arm.say(topics.OPERATOR_ACTIVITY, topics.MISSED, topics.INCAPACITATED)
    assert "0 strikes left" in arm.line()
    arm.say(topics.OPERATOR_ACTIVITY, topics.ALIVE)
    assert "3 strikes left" in arm.line()


def test_strikes_of_an_older_watchdog_are_not_known(arm: Arm) -> None:
    arm.watchdogs.on_next(False)
    assert "strike" not in arm.line()


def test_strikes_are_those_of_the_arm(arm: Arm) -> None:
    arm.report("operator_watchdog", parameter_strikes="5")
    arm.watchdogs.on_next(True)
    assert "5 strikes left" in arm.line()


def test_service_that_complains_is_named(arm: Arm) -> None:
    arm.report("kinematics", level=DiagnosticStatus.WARN)
    assert "1 of 2 ok (kinematics)" in arm.line()
