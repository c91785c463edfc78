"""What the report shows of a violation besides its bound."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pytest

from interfaces.topics import ALIVE, INCAPACITATED, MISSED, OFF, ON, TURN_OFF
from tests.promises.account import account
from tests.promises.findings import Evidence
from tests.promises.history import (
    CONTROLLER,
    DRIVE,
    FALSE_PRESENCE,
    FUTURE_PRESENCE,
    NO_TARGET,
    STUCK_DRIVE,
    SWITCH,
    WATCHDOG,
    History,
    InjectedFault,
    Life,
)
from tests.promises.promises import CHECKERS
from tests.promises.text_report import text

from . import histories

LIVES = [
    Life(SWITCH, 11, 0.0, None),
    Life(CONTROLLER, 12, 0.0, None),
    Life(WATCHDOG, 13, 0.0, 11.5),
    Life(WATCHDOG, 14, 12.0, None),
]
FAULTS = [
    InjectedFault("kill", WATCHDOG, 11.5, 11.5, 13),
    InjectedFault(STUCK_DRIVE, NO_TARGET, 5.0, 30.0),
]


history = partial(histories.history, lives=LIVES, faults=FAULTS)


STILL_ON = history(
    heartbeats=[(4.0, True), (5.0, True)],
    operator_presence=[(4.5, 0.0), (5.0, 0.0)],
    operator_activity=[(5.0, ALIVE), (8.0, MISSED), (11.0, MISSED), (15.0, MISSED), (18.0, MISSED)],
    states=[*((n / 10, ON) for n in range(41, 210)), (21.0, OFF)],
    commands=[(21.0, TURN_OFF)],
)


def test_report_on_engines_that_stay_on_says_who_had_to_act() -> None:
    found = CHECKERS["S1"](STILL_ON)
    (late, *_) = (each for each in found.evidence if "still on" in each.text)
    assert account(STILL_ON, "S1", late) == [
        "dead_mans_switch (11) sent its last heartbeat at 5.00 s",
        "the successor of operator_watchdog since 12.00 s counted 1 of 3 strikes until 15.45 s, at 15.0 s, "
        "the last one was due at 21.00 s; turn_off came at 21.00 s",
        "engine_controller (12) sent its last on at 20.90 s, the drive kept it (injected); "
        "until 15.45 s, the last presence had come at 5.00 s and counts until 15.00 s at most",
        "injected: stuck_drive of (no target) at 5.00 s, kill of operator_watchdog at 11.50 s",
    ]
    shown = text([found], STILL_ON).splitlines()
    assert "    dead_mans_switch (11) sent its last heartbeat at 5.00 s" in shown


@pytest.mark.parametrize(
    ("late", "words"),
    [
        ([], "never incapacitated; turn_off came at 21.00 s"),
        ([(14.0, INCAPACITATED)], "incapacitated at 14.0 s; turn_off came at 21.00 s"),
        (
            [(20.9, MISSED), (20.9, INCAPACITATED)],
            "incapacitated at 20.9 s; turn_off came at 21.00 s, after strike 4 at 20.9 s",
        ),
    ],
)
def test_report_names_what_the_watchdog_concluded_late_and_a_stranger(
    late: list[tuple[float, str]], words: str
) -> None:
    activity = [(7.0, ALIVE), (8.0, MISSED), (11.0, MISSED), (14.0, MISSED), *late]
    slow = replace(
        STILL_ON,
        lives=LIVES[:3],
        faults=[InjectedFault(FALSE_PRESENCE, NO_TARGET, 5.0, 30.0)],
        streams={**STILL_ON.streams, "operator_activity": histories.samples(activity)},
    )
    _, watchdog, controller, *_ = account(slow, "S1", Evidence(15.45, "engines still on"))

    strikes = (
        "operator_watchdog (13) saw the operator until 7.00 s, "
        "and counted 3 of 3 strikes until 15.45 s, at 8.0, 11.0, 14.0 s"
    )
    assert watchdog == f"{strikes}, {words}"
    assert controller.endswith("15.00 s at most, and a stranger sent others (injected)")


@pytest.mark.parametrize(
    ("kind", "end", "words"),
    [
        (FALSE_PRESENCE, 30.0, ", and a stranger sent others (injected)"),
        (FUTURE_PRESENCE, 30.0, ", and a stranger sent others (injected)"),
        (FUTURE_PRESENCE, 20.0, " s at most"),  # it had gone before the last on
    ],
)
def test_report_on_the_controller_names_a_stranger_of_that_time(kind: str, end: float, words: str) -> None:
    judged = replace(STILL_ON, faults=[InjectedFault(kind, NO_TARGET, 5.0, end)])
    assert account(judged, "S1", Evidence(15.45, "engines still on"))[2].endswith(words)


def test_report_names_the_process_and_the_faults_of_its_time() -> None:
    before, after = (
        account(STILL_ON, "L1", Evidence(at, "operator_watchdog is silent for 4.00 s")) for at in (11.0, 18.0)
    )
    assert before[0].startswith("operator_watchdog (13) was heard last")
    assert before[-1] == "injected: stuck_drive of (no target) at 5.00 s"
    assert after[-1] == f"{before[-1]}, kill of operator_watchdog at 11.50 s"


def test_report_on_a_joint_that_moved_too_late_names_the_drive() -> None:
    times = [(20.0, (0.0, "host")), (20.5, (0.1, "host"))]
    moved = replace(
        STILL_ON,
        lives=[*LIVES, Life(DRIVE, 15, 0.0, 19.0), Life(DRIVE, 16, 20.0, None)],
        streams={**STILL_ON.streams, "driven_time": histories.samples(times)},
    )
    *_, drive, _ = account(moved, "S6", Evidence(20.2, "a joint still moved 15.00 s after"))

    assert drive == "drive (16), the successor since 20.00 s, was heard last at 20.00 s, again at 20.50 s"


def test_report_on_another_promise_tells_what_was_said_last() -> None:
    evidence = Evidence(13.0, "operator_watchdog is silent for 4.00 s after SIGKILL")
    assert account(STILL_ON, "L1", evidence) == [
        "operator_watchdog (14), the successor since 12.00 s, was heard last at 5.00 s, never again",
        "last messages before: operator_heartbeat at 5.00 s, operator_presence at 5.00 s, "
        "engines/state on at 13.00 s",
        "injected: stuck_drive of (no target) at 5.00 s, kill of operator_watchdog at 11.50 s",
    ]


@pytest.mark.parametrize(
    ("text", "program"),
    [
        ("the position does not follow from the last values after slow of config_l1", "kinematics"),
        ("kinematics is silent for 0.27 s when config_l1 is killed", "kinematics"),
        ("config_l1 is silent for 10 s after slow", "config_l1"),
        ("no published values give (1.0, 2.0)", "kinematics"),
        ("speed -1.0", "velocity"),
        ("the driven time goes back by 1.50 s", "drive"),
        ("theta1 jumped: 0.79 rad in 0.46 s", "config_theta1"),
        ("engines turned on without a turn_on in the last 1 s", "engine_controller"),
    ],
)
def test_report_tells_of_the_program_that_a_violation_is_about(text: str, program: str) -> None:
    assert account(History(40.0), "L3", Evidence(13.0, text))[0].startswith(f"{program} was heard")


def test_report_on_a_silence_names_what_was_injected_in_it() -> None:
    kills = [InjectedFault("kill", DRIVE, at, at, 9) for at in (15.3, 19.5)]
    silent = replace(
        STILL_ON,
        faults=kills,
        streams={**STILL_ON.streams, "operator_presence": histories.samples([(15.0, 0.0), (18.0, 0.0)])},
    )
    *_, injected = account(silent, "L2", Evidence(15.0, "operator_watchdog is silent for 3.00 s"))

    assert injected == "injected: kill of drive at 15.30 s"


def test_report_counts_the_strikes_before_a_return() -> None:
    activity = [(1.0, MISSED), (2.0, INCAPACITATED), (4.0, MISSED), (5.0, ALIVE), (8.0, MISSED)]
    seen = {"operator_activity": histories.samples(activity)}
    lasting = replace(STILL_ON, lives=LIVES[:3], streams={**STILL_ON.streams, **seen})
    assert account(lasting, "S1", Evidence(15.45, "engines still on"))[1] == (
        "operator_watchdog (13) counted 2 of 3 strikes until 15.45 s, at 4.0, 8.0 s, "
        "the last one was due at 11.00 s; turn_off came at 21.00 s"
    )


def test_report_shows_why_a_process_ended_by_itself() -> None:
    words = "TypeError: unsupported operand"
    ended = [Life(WATCHDOG, 13, 0.0, 11.5, words), Life(WATCHDOG, 14, 12.0, 12.5, words), *LIVES[:2]]
    early = replace(STILL_ON, lives=[*ended, Life(DRIVE, 15, 0.0, 13.1, words), Life(DRIVE, 16, 0.0, 12.0)])
    for promise, what in (("S1", "engines still on"), ("L1", "operator_watchdog is silent")):
        lines = account(early, promise, Evidence(13.0, what))
        assert f"operator_watchdog (14) ended by itself at 12.50 s: {words}" in lines
        assert len(lines) <= 5


def test_report_on_engines_shows_what_the_controller_gave_as_the_cause() -> None:
    words = "turned off by engine_controller (it stood still for 0.5 s)"
    causes = {"engines/cause": [(12.9, "?"), (13.1, words), (14.1, "?")]}
    stopped = history(states=[(12.0, ON), (13.0, OFF), (13.2, OFF), (14.0, ON)], **causes)
    for time, last in ((13.0, 13.0), (13.5, 13.2)):
        assert account(stopped, "S2", Evidence(time, "engines turned off"))[1] == (
            f"last messages before: engines/state off at {last:.2f} s, {words}"
        )


def test_report_on_silence_shows_the_next_message_and_what_the_health_said() -> None:
    said = "effector/speed: it is negative"
    silent = history(
        **{"effector/speed": [(12.0, 1.0), (13.0, 1.0), (13.4, 1.0)]},
        **{"/diagnostics": [(13.3, ("velocity", 7, ("said", said)))]},
    )
    lines = account(silent, "L2", Evidence(13.0, "velocity is silent for 0.40 s when drive is killed"))
    assert lines[0] == f"velocity was heard last at 13.00 s, again at 13.40 s; its health said: {said}"


def test_report_on_a_position_shows_the_values_that_it_follows_from() -> None:
    moved = history(
        l1=[(1.0, 2.0)], theta1=[(2.0, 0.5), (12.0, 0.7)], **{"effector/position": [(11.0, (1.0, 2.0))]}
    )
    evidence = Evidence(13.0, "the position does not follow from the last values after slow of config_l1")
    assert account(moved, "L3", evidence)[1] == (
        "last values before: effector/position (1.0, 2.0) at 11.00 s, l1 2.0 at 1.00 s, theta1 0.7 at 12.00 s"
    )


def test_run_that_exercised_too_little_has_no_moment_to_tell_of() -> None:
    assert account(STILL_ON, "S6", Evidence(40.0, "the run exercised it 0 times, and planned 5 cases")) == []


def test_report_on_nothing_has_no_gap() -> None:
    bare = History(40.0)
    for promise in CHECKERS:
        lines = account(bare, promise, Evidence(13.0, "?"))
        assert 2 <= len(lines) <= 5
        assert lines[-1] == "nothing was injected"
