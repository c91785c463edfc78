"""The checkers on histories made by hand: good ones hold, and each planted violation is detected."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from deploy.promises.findings import HOLDS, UNKNOWN, VIOLATED, percentile
from deploy.promises.history import (
    ALL,
    DEPENDENTS,
    NEEDED_AT_START,
    NO_TARGET,
    OPERATOR,
    PROGRAMS,
    History,
    InjectedFault,
    Life,
    Sample,
)
from deploy.promises.promises import CHECKERS, meaning
from deploy.promises.text_report import text
from interfaces import topics
from interfaces.robot_model import forward_kinematics
from interfaces.topics import OFF, ON, TURN_OFF

from .histories import END, added, change, faulty, good, killed, silent, value_at, with_value


def verdict(promise: str, history: History) -> str:
    return CHECKERS[promise](history).verdict


def asleep(history: History, begin: float, off: float) -> History:
    """Return the history in which the operator falls asleep and the engines turn off."""
    history = silent(history, "operator_heartbeat", begin, END)
    history = silent(history, "operator_presence", begin, END)
    history = with_value(history, "engines/state", OFF, off)
    history = added(history, "engines", (off, TURN_OFF))
    return faulty(history, InjectedFault("silence", OPERATOR, begin, END))


@pytest.mark.parametrize("promise", CHECKERS)
def test_good_history_holds_what_it_exercises(promise: str) -> None:
    finding = CHECKERS[promise](good())
    assert finding.verdict == (HOLDS if promise in ("S3", "S4") else UNKNOWN)
    assert finding.unknown == 0


@pytest.mark.parametrize("promise", CHECKERS)
def test_empty_history_leaves_every_promise_unknown(promise: str) -> None:
    assert verdict(promise, History(0.0)) == UNKNOWN


def test_violation_is_reported_with_its_figures() -> None:
    history = silent(good(), "operator_heartbeat", 20.0, END + 1.0)  # the engines stay on
    row = next(line for line in text([CHECKERS["S1"](history)]).splitlines() if line.startswith("S1"))
    assert "VIOLATED" in row
    assert "off within 40" in row


@pytest.mark.parametrize("promise", CHECKERS)
def test_every_promise_has_a_sentence(promise: str) -> None:
    assert meaning(promise).endswith(".")
    assert meaning("S3") == "Engines turn on only by a turn_on with the operator present."


# S1


def test_s1_holds_if_engines_turn_off_in_time() -> None:
    finding = CHECKERS["S1"](asleep(good(), 20.0, 29.6))
    assert finding.verdict == HOLDS
    assert finding.cases == 1


def test_s1_detects_engines_that_turn_off_too_late() -> None:
    (evidence,) = CHECKERS["S1"](asleep(good(), 20.0, 30.7)).evidence
    assert evidence.time == pytest.approx(30.5)


def test_s1_detects_engines_that_turn_on_again() -> None:
    history = with_value(asleep(good(), 20.0, 29.6), "engines/state", ON, 40.0, 40.3)
    assert verdict("S1", history) == VIOLATED


def test_s1_detects_engines_that_run_before_the_operator_came() -> None:
    assert verdict("S1", silent(good(), "operator_heartbeat", 0.0, 10.0)) == VIOLATED


def test_s1_drive_stops_when_a_dead_controller_renews_nothing() -> None:
    history = silent(asleep(good(), 20.0, 50.0), "engines/state", 29.9, END)
    assert verdict("S1", history) == HOLDS


def test_s1_detects_a_controller_that_is_stopped_too_late() -> None:
    history = silent(asleep(good(), 20.0, 50.0), "engines/state", 30.25, END)
    assert verdict("S1", history) == VIOLATED


def test_s1_released_switch_is_not_a_sign_of_life() -> None:
    history = asleep(good(), 20.0, 50.0)
    history = added(history, "operator_heartbeat", *((20.0 + n, False) for n in range(30)))
    assert verdict("S1", history) == VIOLATED


# S2


def test_s2_holds_if_other_services_are_killed() -> None:
    history = killed(killed(good(), "kinematics", 20.0, 0.6), "operator_watchdog", 30.0, 1.1)
    finding = CHECKERS["S2"](history)
    assert (finding.verdict, finding.cases) == (HOLDS, 2)


def test_s2_detects_engines_that_turn_off_with_operator_present() -> None:
    history = with_value(killed(good(), "operator_watchdog", 30.0, 1.1), "engines/state", OFF, 31.0)
    (evidence,) = CHECKERS["S2"](history).evidence
    assert evidence.time == pytest.approx(31.1)


def test_s2_permits_turn_off_when_the_controller_dies() -> None:
    history = with_value(killed(good(), "engine_controller", 30.0, 0.6), "engines/state", OFF, 30.5)
    assert verdict("S2", history) != VIOLATED


def test_s2_earlier_death_of_the_controller_is_no_reason() -> None:
    history = with_value(killed(good(), "engine_controller", 20.0, 0.6), "engines/state", OFF, 30.5)
    assert verdict("S2", history) == VIOLATED


def test_s2_permits_turn_off_after_three_silences_not_two() -> None:
    history = good()
    for begin in (20.0, 30.0):
        history = silent(history, "operator_heartbeat", begin, begin + 4.0)
    command = (44.05, TURN_OFF)
    assert (
        verdict("S2", added(with_value(history, "engines/state", OFF, 44.0), "engines", command)) == VIOLATED
    )
    history = with_value(silent(history, "operator_heartbeat", 40.0, 44.0), "engines/state", OFF, 44.0)
    assert verdict("S2", history) == VIOLATED  # without a turn_off
    assert verdict("S2", faulty(history, InjectedFault("overload", NO_TARGET, 43.5, 43.9))) != VIOLATED
    assert verdict("S2", added(history, "engines", command)) != VIOLATED


def test_s2_silence_with_a_stopped_watchdog_counts_once() -> None:
    history = silent(good(), "operator_heartbeat", 40.0, 46.2)  # two strikes
    history = added(with_value(history, "engines/state", OFF, 46.2), "engines", (46.15, TURN_OFF))
    pid = next(life.pid for life in history.lives if life.program == "operator_watchdog")
    assert verdict("S2", history) == VIOLATED
    assert (
        verdict("S2", faulty(history, InjectedFault("stop", "operator_watchdog", 40.0, 43.0, pid)))
        == VIOLATED
    )


def test_s2_duplicate_that_ends_itself_is_not_a_successor() -> None:
    history = good()
    for begin in (20.0, 30.0, 40.0):
        history = silent(history, "operator_heartbeat", begin, begin + 4.0)
    history = added(with_value(history, "engines/state", OFF, 44.0), "engines", (44.05, TURN_OFF))
    watchdog = Life("operator_watchdog", 999, 36.0, 36.4)  # the older process has the strikes
    assert verdict("S2", replace(history, lives=[*history.lives, watchdog])) != VIOLATED
    history = with_value(killed(good(), "velocity", 30.0, 0.6), "engines/state", OFF, 30.5)
    controller = Life("engine_controller", 999, 30.3, 30.7)  # the other one turned them off
    assert verdict("S2", replace(history, lives=[*history.lives, controller])) == VIOLATED


def test_s2_replaced_watchdog_starts_without_strikes() -> None:
    history = killed(good(), "operator_watchdog", 13.0, 1.0)
    pid = next(life.pid for life in history.lives if life.program == "operator_watchdog")
    history = faulty(history, InjectedFault("hang", "operator_watchdog", 10.0, 25.0, pid))
    history = added(with_value(history, "engines/state", OFF, 50.0), "engines", (50.05, TURN_OFF))
    assert verdict("S2", history) == VIOLATED


def test_s2_permits_turn_off_10_s_after_the_last_presence() -> None:
    history = with_value(silent(good(), "operator_presence", 30.6, 45.0), "engines/state", OFF, 40.0)
    assert verdict("S2", history) == VIOLATED
    assert verdict("S2", silent(history, "operator_heartbeat", 30.0, 45.0)) != VIOLATED
    assert verdict("S2", silent(history, "operator_heartbeat", 50.0, 55.0)) == VIOLATED  # too late


def test_s2_presence_after_a_suspension_is_as_old_as_its_begin() -> None:
    history = silent(silent(good(), "operator_heartbeat", 20.0, END), "operator_presence", 20.0, END)
    history = with_value(added(history, "operator_presence", (21.0, 20.0)), "engines/state", OFF, 29.9)
    assert verdict("S2", history) == VIOLATED
    assert verdict("S2", faulty(history, InjectedFault("slow", "operator_watchdog", 19.9, 20.9))) != VIOLATED
    assert verdict("S2", faulty(history, InjectedFault("slow", "operator_watchdog", 19.8, 20.8))) == VIOLATED


def test_s2_permits_turn_off_after_a_stopped_controller() -> None:
    history = with_value(silent(good(), "engines/state", 30.0, 31.55), "engines/state", OFF, 31.5)
    assert verdict("S2", history) == VIOLATED
    assert verdict("S2", faulty(history, InjectedFault("stop", "engine_controller", 30.0, 31.5))) != VIOLATED


# S3


def test_s3_holds_if_a_present_operator_turns_on() -> None:
    assert verdict("S3", good()) == HOLDS


def test_s3_detects_turn_on_without_a_command() -> None:
    assert verdict("S3", with_value(good(), "engines/state", OFF, 20.0, 25.0)) == VIOLATED


def test_s3_detects_a_second_turn_on_by_one_command() -> None:
    assert verdict("S3", with_value(good(), "engines/state", OFF, 5.25, 5.65)) == VIOLATED


def test_s3_detects_turn_on_without_an_operator() -> None:
    assert verdict("S3", silent(good(), "operator_heartbeat", 3.0, 6.0)) == VIOLATED


def test_s3_detects_a_start_after_a_pause_without_a_command() -> None:
    assert verdict("S3", silent(good(), "engines/state", 20.0, 21.5)) == VIOLATED
    assert verdict("S3", silent(good(), "engines/state", 20.0, 20.35)) == HOLDS


def test_s3_detects_a_controller_that_restarts_on() -> None:
    assert verdict("S3", killed(good(), "engine_controller", 20.0, 0.6)) == VIOLATED


def test_s3_is_unknown_if_the_observer_was_overloaded() -> None:
    history = faulty(silent(good(), "engines/state", 20.0, 21.5), InjectedFault("overload", "", 20.0, 21.4))
    finding = CHECKERS["S3"](history)
    assert (finding.verdict, finding.unknown) == (HOLDS, 1)


def test_s3_is_unknown_if_the_command_may_have_been_missed() -> None:
    history = killed(with_value(good(), "engines/state", OFF, 20.0, 25.0), "dead_mans_switch", 23.0, 0.6)
    finding = CHECKERS["S3"](history)
    assert (finding.verdict, finding.unknown) == (HOLDS, 1)


# S4


@pytest.mark.parametrize("speed", [-0.1, math.nan, math.inf, -math.inf])
def test_s4_detects_an_invalid_speed(speed: float) -> None:
    assert verdict("S4", added(good(), "effector/speed", (30.0, speed))) == VIOLATED


@pytest.mark.parametrize("position", [(1.0, 9.0), (math.nan, 0.0), (math.inf, 1.0)])
def test_s4_detects_a_position_of_no_published_values(position: tuple[float, float]) -> None:
    assert verdict("S4", added(good(), "effector/position", (30.0, position))) == VIOLATED


def test_s4_position_of_older_values_is_valid() -> None:
    history = good()
    old = next(s for s in history.streams["effector/position"] if s.sent > 20.0)
    assert verdict("S4", added(history, "effector/position", (24.0, old.value))) == HOLDS


@pytest.mark.parametrize(
    ("topic", "value"),
    [("theta1", math.inf), ("theta2", math.nan), ("l1", math.inf), ("l2", -1.0), ("theta2", 1.7e308)],
)
def test_s4_ignores_a_value_that_gives_no_position(topic: str, value: float) -> None:
    assert verdict("S4", added(good(), topic, (30.0, value), (30.01, value))) == HOLDS


def test_s4_angles_of_an_infinite_sum_give_no_position() -> None:
    history = good()
    l1, l2, _, theta2 = (
        max(s for s in history.streams[name] if s.sent <= 30.0).value for name in topics.CONFIGURATION
    )
    history = added(history, "theta1", (30.001, 1.7e308))
    history = added(history, "effector/position", (30.002, forward_kinematics(l1, l2, 1.7e308, theta2)))
    assert verdict("S4", added(history, "theta2", (30.003, 1.7e308))) == HOLDS


def test_s4_detects_a_wrong_position_beyond_the_largest_length() -> None:
    values = {"l1": 1e308, "l2": 1.0, "theta1": 1.25 * math.pi, "theta2": 0.0}
    streams = {name: [Sample(1.0, 1.001, value)] for name, value in values.items()}
    streams["effector/position"] = [Sample(2.0, 2.001, (0.8e308, 0.8e308))]
    assert verdict("S4", History(END, streams)) == VIOLATED


def test_s4_dropped_value_leaves_the_one_before_it_the_latest() -> None:
    history = good()
    for name in topics.CONFIGURATION:
        history = silent(history, name, 2.0, END)
    position = forward_kinematics(*(history.streams[name][-1].value for name in topics.CONFIGURATION))
    history = added(history, "l1", (2.5, -1.0))
    positions = {"effector/position": [Sample(50.0, 50.001, position)]}
    assert verdict("S4", replace(history, streams=history.streams | positions)) == HOLDS


@pytest.mark.parametrize("length", [1e-3, 1e3, 1e6, 1e8, 1e12, 1e20, 1e300])
def test_s4_position_of_long_links_is_right_up_to_its_rounding(length: float) -> None:
    def published(number: int, wrong_by: float) -> History:
        """Return a history of values, each with a position that is wrong by a share of the length."""
        streams: dict[str, list[Sample]] = {name: [] for name in (*topics.CONFIGURATION, "effector/position")}
        for step in range(number):
            at = 1.0 + step / 10.0
            values = length * (1.0 + step), length * (3.3 - step / 61.0), 0.3 + step, 0.4 + 2.7 * step
            for name, value in zip(topics.CONFIGURATION, values, strict=True):
                streams[name].append(Sample(at, at + 0.001, value))
            x, y = forward_kinematics(*values)
            streams["effector/position"].append(Sample(at + 0.01, at + 0.011, (x + wrong_by * length, y)))
        return History(END, streams)

    assert verdict("S4", published(200, wrong_by=0.0)) == HOLDS
    assert verdict("S4", published(9, wrong_by=max(1e-12, 2e-8 / length))) == VIOLATED


def test_s4_is_unknown_if_a_value_may_have_been_missed() -> None:
    history = added(killed(good(), "config_l1", 29.0, 0.5), "effector/position", (29.6, (1.0, 9.0)))
    finding = CHECKERS["S4"](history)
    assert finding.verdict == HOLDS
    assert finding.unknown >= 1


@pytest.mark.parametrize(
    ("at", "expected"), [(28.97, VIOLATED), (29.01, HOLDS), (29.1, HOLDS), (30.7, VIOLATED)]
)
def test_s4_is_unknown_until_a_killed_source_sends_again(at: float, expected: str) -> None:
    history = replace(killed(good(), "config_l1", 29.0, 0.5), lives=good().lives)
    assert verdict("S4", added(history, "effector/position", (at, (1.0, 9.0)))) == expected


def test_s4_is_unknown_on_a_lossy_network() -> None:
    history = added(good(), "effector/position", (30.0, (1.0, 9.0)))
    finding = CHECKERS["S4"](faulty(history, InjectedFault("loss", NO_TARGET, 0.0, END)))
    assert (finding.verdict, finding.unknown) == (HOLDS, 1)


def test_s4_is_unknown_if_the_record_may_have_ended_before_the_value() -> None:
    history = added(good(), "effector/position", (END - 0.01, (1.0, 9.0)))
    finding = CHECKERS["S4"](history)
    assert (finding.verdict, finding.unknown) == (HOLDS, 1)
    assert verdict("S4", added(good(), "effector/position", (END - 0.2, (1.0, 9.0)))) == VIOLATED


# S5


def test_s5_holds_for_successors() -> None:
    assert verdict("S5", killed(good(), "kinematics", 20.0, 0.6)) == HOLDS


def test_s5_detects_two_live_instances() -> None:
    history = good()
    history = replace(history, lives=[*history.lives, Life("kinematics", 777, 20.0, 40.0)])
    assert verdict("S5", history) == VIOLATED


def test_s5_permits_a_duplicate_that_ends_itself() -> None:
    history = good()
    history = replace(history, lives=[*history.lives, Life("kinematics", 777, 20.0, 22.0)])
    assert verdict("S5", history) == HOLDS


def test_s5_permits_a_duplicate_that_starts_slowly_on_an_overloaded_machine() -> None:
    history = good()
    history = replace(history, lives=[*history.lives, Life("kinematics", 777, 20.0, 24.0)])
    assert verdict("S5", history) == VIOLATED
    overload = InjectedFault("overload", NO_TARGET, 21.8, 22.0)
    assert verdict("S5", faulty(history, overload)) == HOLDS
    earlier = overload._replace(begin=21.7, end=21.9)  # 2.1 s before the duplicate ends
    assert verdict("S5", faulty(history, earlier)) == VIOLATED
    reporting = added(faulty(history, overload), "/diagnostics", (23.0, ("kinematics", 777)))
    assert verdict("S5", reporting) == VIOLATED


def test_s5_detects_two_that_report_health_in_turn() -> None:
    reports = ((20.0 + n, ("kinematics", 777)) for n in range(3))
    assert verdict("S5", added(good(), "/diagnostics", *((t + 0.5, v) for t, v in reports))) == VIOLATED


def test_s5_detects_one_report_of_a_second_instance() -> None:
    history = good()
    history = replace(history, lives=[*history.lives, Life("kinematics", 777, 20.0, 20.3)])
    history = added(history, "/diagnostics", (20.2, ("kinematics", 777)))
    (evidence,) = CHECKERS["S5"](history).evidence
    assert evidence == (20.2, "process 777 runs kinematics while process 105 lives")


def test_s5_is_unknown_if_the_end_of_the_first_may_have_been_noted_late() -> None:
    history = killed(good(), "kinematics", 20.0, 0.1)
    first = next(life for life in history.lives if life.program == "kinematics")
    history = replace(
        history, lives=[life._replace(ended=20.9) if life == first else life for life in history.lives]
    )
    history = added(history, "/diagnostics", (20.7, ("kinematics", 1105)))
    assert verdict("S5", history) == VIOLATED
    finding = CHECKERS["S5"](faulty(history, InjectedFault("overload", NO_TARGET, 20.5, 20.9)))
    assert (finding.verdict, finding.unknown) == (HOLDS, 1)


# L1


def test_l1_holds_if_output_resumes_soon() -> None:
    finding = CHECKERS["L1"](killed(good(), "kinematics", 20.0, 0.6))
    assert finding.verdict == HOLDS
    assert finding.times["kinematics"] == [pytest.approx(0.621, abs=0.02)]


@pytest.mark.parametrize(("back", "words"), [(1.2, "median"), (2.5, "silent"), (99.0, "for good")])
def test_l1_detects_output_that_resumes_late_or_never(back: float, words: str) -> None:
    history = good()
    for at in (30.0, 20.0, 10.0):
        history = killed(history, "kinematics", at, back)
    finding = CHECKERS["L1"](history)
    assert finding.verdict == VIOLATED
    assert any(words in evidence.text for evidence in finding.evidence)


def test_l1_detects_silence_for_good_after_any_fault() -> None:
    history = good()
    for topic in history.streams:
        history = silent(history, topic, 20.0, END)
    finding = CHECKERS["L1"](faulty(history, InjectedFault("kill_supervisor", ALL, 20.0, 21.0)))
    # Programs that wait for silent sources are silent, too.
    waiting = {*NEEDED_AT_START, *(each for program in NEEDED_AT_START for each in DEPENDENTS[program])}
    assert len(finding.evidence) == len(set(PROGRAMS) - waiting)


def test_l1_silence_of_all_that_waits_for_a_dead_source_is_explained() -> None:
    history = good()
    for topic in ("l1", "effector/position", "effector/speed", "joint_states"):
        history = silent(history, topic, 20.0, END)
    finding = CHECKERS["L1"](faulty(history, InjectedFault("kill_supervisor", ALL, 20.0, 21.0)))
    assert [evidence.text for evidence in finding.evidence] == [
        "config_l1 is silent for 10 s after kill_supervisor"
    ]


def test_l1_is_unknown_if_a_second_fault_interferes() -> None:
    history = faulty(killed(good(), "kinematics", 20.0, 5.0), InjectedFault("kill_all", ALL, 20.5, 20.5))
    finding = CHECKERS["L1"](history)
    assert (finding.verdict, finding.unknown) == (UNKNOWN, 1)


@pytest.mark.parametrize("kind", ["flood", "babble"])
def test_l1_injected_heartbeats_are_not_output_of_the_switch(kind: str) -> None:
    history = killed(good(), "dead_mans_switch", 20.0, 99.0)
    history = added(history, "operator_heartbeat", *((20.0 + n / 10, True) for n in range(1, 50)))
    finding = CHECKERS["L1"](faulty(history, InjectedFault(kind, NO_TARGET, 19.0, 25.0)))
    assert (finding.cases, finding.unknown) == (0, 1)


def test_l1_released_switch_is_no_case() -> None:
    history = asleep(good(), 20.0, 29.6)
    history = killed(history, "dead_mans_switch", 25.0, 0.6)
    assert verdict("L1", history) == UNKNOWN


@pytest.mark.parametrize("program", ["kinematics", "robot_state"])
def test_l1_restart_that_waits_for_a_dead_source_is_no_case(program: str) -> None:
    history = killed(good(), program, 20.0, 3.0)
    assert verdict("L1", history) == VIOLATED
    assert CHECKERS["L1"](silent(history, "l1", 18.0, 23.0)).unknown == 1
    assert verdict("L1", silent(history, "l1", 18.9, 19.9)) == VIOLATED  # a late message is no dead source


# L2


def test_l2_holds_if_the_other_streams_flow() -> None:
    finding = CHECKERS["L2"](killed(good(), "kinematics", 20.0, 0.6))
    assert (finding.verdict, finding.cases) == (HOLDS, 8)


def test_l2_detects_a_stream_that_pauses() -> None:
    history = silent(killed(good(), "kinematics", 20.0, 0.6), "theta1", 20.1, 20.5)
    (evidence,) = CHECKERS["L2"](history).evidence
    assert "config_theta1 is silent" in evidence.text


def test_l1_is_unknown_if_the_whole_machine_paused() -> None:
    history = killed(good(), "kinematics", 20.0, 2.5)
    assert verdict("L1", history) == VIOLATED
    assert verdict("L1", faulty(history, InjectedFault("overload", NO_TARGET, 20.5, 20.8))) == VIOLATED
    finding = CHECKERS["L1"](faulty(history, InjectedFault("overload", NO_TARGET, 20.5, 21.5)))
    assert (finding.verdict, finding.unknown) == (UNKNOWN, 1)


@pytest.mark.parametrize("end", [23.0, END])
def test_l2_detects_a_pause_longer_than_the_restart(end: float) -> None:
    history = silent(killed(good(), "kinematics", 20.0, 0.25), "theta1", 20.1, end)
    (evidence,) = CHECKERS["L2"](history).evidence
    assert "config_theta1 is silent" in evidence.text


def test_l2_ignores_a_pause_by_another_fault() -> None:
    history = killed(killed(good(), "kinematics", 20.0, 0.25), "config_theta1", 20.4, 0.8)
    assert verdict("L2", history) == HOLDS


def test_l2_replaced_process_is_no_longer_disturbed() -> None:
    history = killed(killed(good(), "config_theta1", 7.0, 0.5), "kinematics", 20.0, 0.6)
    history = silent(history, "theta1", 20.1, 20.5)
    pid = next(life.pid for life in history.lives if life.program == "config_theta1")
    hang = InjectedFault("hang", "config_theta1", 5.0, 18.0, pid)
    assert verdict("L2", faulty(history, hang)) == VIOLATED
    assert verdict("L2", faulty(history, hang._replace(pid=0))) == HOLDS


def test_l2_pause_of_the_machine_does_not_hide_another_pause() -> None:
    history = silent(killed(good(), "kinematics", 20.0, 0.6), "theta1", 20.1, 20.5)
    assert verdict("L2", faulty(history, InjectedFault("overload", NO_TARGET, 20.05, 20.12))) == VIOLATED
    stalled = faulty(history, InjectedFault("overload", NO_TARGET, 20.05, 20.4))
    finding = CHECKERS["L2"](stalled)
    assert (finding.verdict, finding.cases, finding.unknown) == (HOLDS, 7, 1)
    (evidence,) = CHECKERS["L2"](silent(stalled, "l1", 20.41, 20.79)).evidence
    assert "config_l1 is silent" in evidence.text


def test_l2_speed_may_pause_with_positions() -> None:
    history = silent(killed(good(), "kinematics", 20.0, 0.6), "effector/speed", 20.0, 20.7)
    assert verdict("L2", history) == HOLDS


# L3


def test_l3_holds_if_positions_are_right_after_a_restart() -> None:
    assert verdict("L3", killed(good(), "kinematics", 20.0, 0.6)) == HOLDS


def test_l3_detects_positions_of_outdated_values() -> None:
    history = killed(good(), "kinematics", 20.0, 0.6)
    stale = next(s.value for s in history.streams["effector/position"] if s.sent > 19.0)

    def keep(sample: Sample) -> Sample:
        return sample._replace(value=stale) if 20.5 < sample.sent < 25.0 else sample

    assert verdict("L3", change(history, "effector/position", keep)) == VIOLATED


def test_l3_is_unknown_if_a_value_may_have_been_missed() -> None:
    def of_another_value(history: History) -> History:
        other = (0.123, 0.456)
        return change(
            history,
            "effector/position",
            lambda s: s._replace(value=other) if 21.6 < s.sent < 22.2 else s,
        )

    history = killed(good(), "kinematics", 20.0, 0.6)
    assert verdict("L3", of_another_value(history)) == VIOLATED
    finding = CHECKERS["L3"](faulty(of_another_value(history), InjectedFault("loss", NO_TARGET, 0.0, END)))
    assert (len(finding.evidence), finding.unknown) == (0, 1)
    finding = CHECKERS["L3"](of_another_value(killed(history, "config_l1", 21.5, 0.6)))
    assert (len(finding.evidence), finding.unknown) == (0, 1)


# L4


def hung(replaced_after: float) -> History:
    history = silent(good(), "effector/position", 20.0, 20.0 + replaced_after)
    return faulty(history, InjectedFault("stop", "kinematics", 20.0, 35.0, 105))


def test_l4_holds_if_a_hung_process_is_replaced_soon() -> None:
    assert verdict("L4", hung(3.9)) == HOLDS


@pytest.mark.parametrize("after", [5.2, 15.0, 99.0])
def test_l4_detects_a_late_or_missing_replacement(after: float) -> None:
    assert verdict("L4", hung(after)) == VIOLATED


def test_l4_is_unknown_if_the_sentinel_was_hit() -> None:
    history = faulty(hung(6.5), InjectedFault("kill", "sentinel", 22.0, 22.0))
    finding = CHECKERS["L4"](history)
    assert (finding.cases, finding.unknown) == (0, 1)


def test_l4_successor_of_a_hung_sentinel_is_its_replacement() -> None:
    history = silent(good(), "/diagnostics", 20.0, 23.5)
    lives = [life._replace(ended=23.0) if life.program == "sentinel" else life for life in history.lives]
    history = replace(history, lives=[*lives, Life("sentinel", 999, 23.0, None)])
    finding = CHECKERS["L4"](faulty(history, InjectedFault("stop", "sentinel", 20.0, 35.0, 111)))
    assert (finding.cases, finding.unknown) == (1, 0)


def test_percentiles_are_nearest_ranks() -> None:
    values = [float(n) for n in range(1, 101)]
    assert (percentile(values, 50), percentile(values, 99)) == (50.0, 99.0)
    assert math.isnan(percentile([], 50))
    assert value_at("l1", 0.0) == 2.0
