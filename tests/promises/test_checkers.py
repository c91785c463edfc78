"""The checkers on histories made by hand, besides those of test_findings.py and test_bounds.py."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest

from interfaces import topics
from interfaces.robot_model import forward_kinematics
from interfaces.topics import OFF, ON, TURN_OFF
from tests.promises import promises
from tests.promises.effects import effects
from tests.promises.findings import HOLDS, UNKNOWN, VIOLATED, percentile
from tests.promises.history import (
    ALL,
    DEPENDENTS,
    NEEDED_AT_START,
    NO_TARGET,
    Condition,
    History,
    InjectedFault,
    Life,
    Sample,
    programs_of_manifest,
)
from tests.promises.promises import CHECKERS, meaning
from tests.promises.text_report import text

from .histories import END, added, change, faulty, good, killed, silent, succeeded, value_at, with_value


def verdict(promise: str, history: History) -> str:
    return CHECKERS[promise](history).verdict


def asleep(history: History, begin: float, off: float) -> History:
    """Return the history in which the operator falls asleep and the engines turn off."""
    history = silent(history, "operator_heartbeat", begin, END)
    history = silent(history, "operator_presence", begin, END)
    history = with_value(history, "engines/state", OFF, off)
    history = added(history, "engines", (off, TURN_OFF))
    return faulty(history, Condition("silence", begin, END))


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


def test_s1_detects_engines_that_turn_on_again() -> None:
    history = with_value(asleep(good(), 20.0, 29.6), "engines/state", ON, 40.0, 40.3)
    assert verdict("S1", history) == VIOLATED


def test_s2_permits_a_crash_loop_of_the_watchdog_if_engines_wait_less() -> None:
    loop = InjectedFault("crash_loop", "operator_watchdog", 20.0, 24.0)
    history = faulty(silent(good(), "operator_presence", 20.0, 25.0), loop)
    history = with_value(history, "engines/state", OFF, 21.5)
    assert verdict("S2", history) == VIOLATED
    quick = ("presence_timeout", 1.36), ("max_presence_age", 0.2)
    watchdog = ("lifespan", 0.12), ("sampling", 0.04), ("silence", 0.29), ("strikes", 1)
    history = added(history, "/diagnostics", (6.0, ("engine_controller", 110, *quick)))
    history = added(history, "/diagnostics", (6.0, ("operator_watchdog", 109, *watchdog)))
    assert verdict("S2", history) == UNKNOWN


def test_s2_permits_a_silence_that_nonsense_makes_longer() -> None:
    history = silent(good(), "operator_heartbeat", 30.0, 36.0)
    history = added(with_value(history, "engines/state", OFF, 30.15), "engines", (30.19, TURN_OFF))
    quick = ("lifespan", 0.12), ("sampling", 0.04), ("silence", 0.29), ("strikes", 1)
    history = added(history, "/diagnostics", (6.0, ("operator_watchdog", 109, *quick)))
    assert verdict("S2", history) == VIOLATED
    assert verdict("S2", faulty(history, InjectedFault("babble", NO_TARGET, 29.5, 33.0))) == UNKNOWN


def test_s1_is_judged_by_the_parameters_that_the_services_report() -> None:
    quick = (("silence", 0.6), ("strikes", 1))
    history = added(good(), "/diagnostics", (6.0, ("operator_watchdog", 109, *quick)))
    assert history.reaction.off_undisturbed == 1.65
    assert verdict("S1", asleep(history, 20.0, 21.5)) == HOLDS
    assert verdict("S1", asleep(history, 20.0, 21.7)) == VIOLATED


def test_s1_released_switch_is_not_a_sign_of_life() -> None:
    history = asleep(good(), 20.0, 50.0)
    history = added(history, "operator_heartbeat", *((20.0 + n, False) for n in range(30)))
    assert any("for 30.10 s in all" in each.text for each in CHECKERS["S1"](history).evidence)


# S2


def test_s2_duplicate_that_ends_itself_is_not_a_successor() -> None:
    history = good()
    for begin in (20.0, 30.0, 40.0):
        history = silent(history, "operator_heartbeat", begin, begin + 4.0)
    history = added(with_value(history, "engines/state", OFF, 44.0), "engines", (44.05, TURN_OFF))
    watchdog = Life("operator_watchdog", 999, 36.0, 36.4)  # the older process has the strikes
    assert verdict("S2", replace(history, lives=[*history.lives, watchdog])) != VIOLATED
    history = with_value(killed(good(), "velocity", 30.0, 0.6), "engines/state", OFF, 30.5)
    controller = Life("engine_controller", 999, 30.55, 30.95)  # the other one turned them off
    assert verdict("S2", replace(history, lives=[*history.lives, controller])) == VIOLATED


def test_s2_permits_a_stop_a_little_early_if_the_last_presence_came_too_late() -> None:
    history = silent(good(), "operator_heartbeat", 20.01, END)
    history = silent(history, "operator_presence", 20.01, END)
    history = with_value(history, "engines/state", OFF, 29.6)
    assert verdict("S2", history) == VIOLATED
    assert verdict("S2", faulty(history, InjectedFault("hold", "operator_presence", 19.8, 22.0))) == UNKNOWN


def test_s2_counts_kills_while_a_slow_switch_is_held() -> None:
    history = reporting(slowed(good(), "operator_heartbeat", 1.0), "engine_controller", max_presence_age=0.05)
    assert CHECKERS["S2"](reporting(history, "dead_mans_switch", rate=20.0)).cases < 4
    assert CHECKERS["S2"](reporting(history, "dead_mans_switch", rate=1.0)).cases == 4


def test_s2_permits_no_stop_while_a_slow_switch_is_held() -> None:
    history = reporting(slowed(good(), "operator_heartbeat", 1.0), "engine_controller", max_presence_age=0.05)
    history = with_value(silent(history, "operator_presence", 20.0, END), "engines/state", OFF, 35.0)
    assert verdict("S2", reporting(history, "dead_mans_switch", rate=20.0)) != VIOLATED
    assert verdict("S2", reporting(history, "dead_mans_switch", rate=1.0)) == VIOLATED


# S3


def test_s3_detects_a_start_after_a_pause_without_a_command() -> None:
    assert verdict("S3", silent(good(), "engines/state", 20.0, 21.5)) == VIOLATED
    assert verdict("S3", silent(good(), "engines/state", 20.0, 20.35)) == HOLDS


# S4


@pytest.mark.parametrize("speed", [-0.1, math.nan, math.inf, -math.inf])
def test_s4_detects_an_invalid_speed(speed: float) -> None:
    assert verdict("S4", added(good(), "effector/speed", (30.0, speed))) == VIOLATED


@pytest.mark.parametrize("position", [(1.0, 9.0), (math.nan, 0.0), (math.inf, 1.0), (1.5e308, 1.5e308)])
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


def test_s4_dropped_value_leaves_the_one_before_it_the_latest() -> None:
    history = good()
    for name in topics.CONFIGURATION:
        history = silent(history, name, 2.0, END)
    position = forward_kinematics(*(history.streams[name][-1].value for name in topics.CONFIGURATION))
    history = added(history, "l1", (2.5, -1.0))
    positions = {"effector/position": [Sample(50.0, 50.001, position)]}
    assert verdict("S4", replace(history, streams=history.streams | positions)) == HOLDS


@pytest.mark.parametrize("length", [1e-3, 1e3, 1e6, 4e6])
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


def with_only_position(history: History, at: float) -> History:
    """Return the history with one position, of no published values: to explain each of them takes long."""
    return replace(history, streams=history.streams | {"effector/position": [Sample(at, at, (1.0, 9.0))]})


@pytest.mark.parametrize(("at", "expected"), [(29.6, HOLDS), (30.49, HOLDS), (30.51, VIOLATED)])
def test_s4_is_unknown_if_a_value_may_have_been_missed(at: float, expected: str) -> None:
    finding = CHECKERS["S4"](with_only_position(killed(good(), "config_l1", 29.0, 0.5), at))
    assert (finding.verdict, finding.unknown) == (expected, expected == HOLDS)


@pytest.mark.parametrize(
    ("at", "expected"), [(28.97, VIOLATED), (29.01, HOLDS), (29.1, HOLDS), (30.7, VIOLATED)]
)
def test_s4_is_unknown_until_a_killed_source_sends_again(at: float, expected: str) -> None:
    history = replace(killed(good(), "config_l1", 29.0, 0.5), lives=good().lives)
    assert verdict("S4", with_only_position(history, at)) == expected


def test_s4_is_unknown_on_a_lossy_network() -> None:
    history = added(good(), "effector/position", (30.0, (1.0, 9.0)))
    finding = CHECKERS["S4"](faulty(history, Condition("loss", 0.0, END)))
    assert (finding.verdict, finding.unknown) == (HOLDS, 1)


def test_s4_is_unknown_if_the_record_may_have_ended_before_the_value() -> None:
    history = added(good(), "effector/position", (END - 0.01, (1.0, 9.0)))
    finding = CHECKERS["S4"](history)
    assert (finding.verdict, finding.unknown) == (HOLDS, 1)
    assert verdict("S4", added(good(), "effector/position", (END - 0.2, (1.0, 9.0)))) == VIOLATED


# S5


def test_s5_holds_for_successors() -> None:
    assert verdict("S5", killed(good(), "kinematics", 20.0, 0.6)) == HOLDS


def test_s5_permits_a_second_process_that_never_reports_however_long_it_lives() -> None:
    history = good()
    history = replace(history, lives=[*history.lives, Life("kinematics", 777, 20.0, 40.0)])
    assert verdict("S5", history) == HOLDS
    assert verdict("S5", added(history, "/diagnostics", (39.0, ("kinematics", 777)))) == VIOLATED


def test_s5_detects_a_second_process_that_reports_before_the_first() -> None:
    history = good()  # all report at 1 s
    history = replace(history, lives=[*history.lives, Life("kinematics", 777, 0.5, 5.0)])
    assert verdict("S5", added(history, "/diagnostics", (0.75, ("kinematics", 777)))) == VIOLATED


# L1


def test_l1_detects_silence_for_good_after_any_fault() -> None:
    history = good()
    for topic in history.streams:
        history = silent(history, topic, 20.0, END)
    finding = CHECKERS["L1"](faulty(history, InjectedFault("kill_supervisor", ALL, 20.0, 21.0)))
    # Programs that wait for silent sources are silent, too.
    waiting = {*NEEDED_AT_START, *(each for program in NEEDED_AT_START for each in DEPENDENTS[program])}
    assert len(finding.evidence) == len(set(programs_of_manifest()) - waiting)


def test_l1_silence_of_all_that_waits_for_a_dead_source_is_explained() -> None:
    history = good()
    for topic in ("l1", "effector/position", "effector/speed", "joint_states"):
        history = silent(history, topic, 20.0, END)
    finding = CHECKERS["L1"](faulty(history, InjectedFault("kill_supervisor", ALL, 20.0, 21.0)))
    assert [evidence.text for evidence in finding.evidence] == [
        "config_l1 is silent for 10 s after kill_supervisor"
    ]


POSITION, SPEED, STATES = "effector/position", "effector/speed", "joint_states"


@pytest.mark.parametrize(
    ("program", "gone", "back", "found"),
    [
        ("kinematics", (POSITION, SPEED), 22.5, True),
        ("kinematics", (POSITION, SPEED), 25.0, True),
        ("kinematics", (POSITION, SPEED), 25.2, False),
        ("robot_state", (STATES,), 25.0, True),
        ("robot_state", (STATES,), 25.2, False),
        ("velocity", (SPEED,), 25.2, True),
        ("velocity", (SPEED,), 29.0, False),  # it stands still
    ],
)
def test_l1_program_that_stays_away_after_the_sources_are_back_is_found(
    program: str, gone: tuple[str, ...], back: float, found: bool
) -> None:
    history = faulty(good(), InjectedFault("kill_all", ALL, 20.1, 20.1))
    for topic in history.streams:
        history = silent(history, topic, 20.0, END if topic in gone else back)
    texts = [each.text for each in CHECKERS["L1"](history).evidence]
    assert texts == [f"{program} is silent for 10 s after kill_all"] * found


@pytest.mark.parametrize(
    ("start_timeout", "kind", "heard", "found"),
    [
        ({"start_timeout": 31.0}, "hang", 19.9, False),
        ({"start_timeout": 12.0}, "hang", 19.9, True),
        ({}, "hang", 19.9, True),
        ({"start_timeout": 31.0}, "hang", 20.3, True),  # after its first sign of life
        ({"start_timeout": 31.0}, "stop", 19.9, True),  # that ends by itself
    ],
)
def test_l1_hang_in_a_start_lasts_until_the_sentinel_kills(
    start_timeout: dict[str, float], kind: str, heard: float, found: bool
) -> None:
    lives = [life._replace(ended=20.0) if life.program == "velocity" else life for life in good().lives]
    history = replace(good(), lives=[*lives, Life("velocity", 7, 20.0, None)])
    history = faulty(history, InjectedFault(kind, "velocity", 20.4, 24.4, 7))
    history = silent(history, "effector/speed", heard, END)
    reports = [
        each
        for each in history.stream(topics.DIAGNOSTICS)
        if each.value[0] != "velocity" or each.sent < heard
    ]
    reports.append(Sample(1.0, 1.0, ("sentinel", 5, *start_timeout.items())))
    history = replace(history, streams={**history.streams, "/diagnostics": reports})
    texts = [each.text for each in CHECKERS["L1"](history).evidence]
    assert texts == [f"velocity is silent for 10 s after {kind}"] * found


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


@pytest.mark.parametrize("end", [23.0, END])
def test_l2_detects_a_pause_longer_than_the_restart(end: float) -> None:
    history = silent(killed(good(), "kinematics", 20.0, 0.25), "theta1", 20.1, end)
    (evidence,) = CHECKERS["L2"](history).evidence
    assert "config_theta1 is silent" in evidence.text


def test_l2_replaced_process_is_no_longer_disturbed() -> None:
    history = killed(killed(good(), "config_theta1", 7.0, 0.5), "kinematics", 20.0, 0.6)
    history = silent(history, "theta1", 20.1, 20.5)
    pid = next(life.pid for life in history.lives if life.program == "config_theta1")
    hang = InjectedFault("hang", "config_theta1", 5.0, 18.0, pid)
    assert verdict("L2", faulty(history, hang)) == VIOLATED
    assert verdict("L2", faulty(history, hang._replace(pid=0))) == HOLDS


def test_l2_speed_may_pause_with_positions() -> None:
    history = silent(killed(good(), "kinematics", 20.0, 0.6), "effector/speed", 20.0, 20.7)
    assert verdict("L2", history) == HOLDS


@pytest.mark.parametrize(
    ("killed", "moving", "judged"),
    [("config_l2", {"l2"}, False), ("drive", {"theta1", "theta2"}, False), ("config_l2", {"l2", "l1"}, True)],
)
def test_l2_kinematics_need_not_go_on_without_a_source(killed: str, moving: set[str], judged: bool) -> None:
    history = faulty(good(), InjectedFault("kill", killed, 20.0, 20.0))
    for topic in topics.CONFIGURATION.keys() - moving:
        history = silent(history, topic, 0.2, END)
    history = silent(history, "effector/position", 20.0, 20.3)  # longer than each source is silent
    found = [each for each in CHECKERS["L2"](history).evidence if "kinematics" in each.text]
    assert bool(found) is judged


def test_l2_kinematics_may_pause_with_its_sources() -> None:
    history = killed(good(), "drive", 20.0, 0.6)
    for topic in (*topics.CONFIGURATION, "effector/position", "effector/speed"):
        history = silent(history, topic, 20.0, 20.5)
    assert not [each for each in CHECKERS["L2"](history).evidence if "kinematics" in each.text]
    moved = added(history, "l1", (20.2, 2.0), (20.4, 2.0))
    assert [each for each in CHECKERS["L2"](moved).evidence if "kinematics" in each.text]


# L3


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
    finding = CHECKERS["L3"](faulty(of_another_value(history), Condition("loss", 0.0, END)))
    assert (len(finding.evidence), finding.unknown) == (0, 1)
    finding = CHECKERS["L3"](of_another_value(killed(history, "config_l1", 21.5, 0.6)))
    assert (len(finding.evidence), finding.unknown) == (0, 1)


# L4


def hung(replaced_after: float) -> History:
    history = silent(good(), "effector/position", 20.0, 20.0 + replaced_after)
    return faulty(history, InjectedFault("stop", "kinematics", 20.0, 35.0, 105))


@pytest.mark.parametrize("after", [5.2, 15.0, 99.0])
def test_l4_detects_a_late_or_missing_replacement(after: float) -> None:
    assert verdict("L4", hung(after)) == VIOLATED


@pytest.mark.parametrize(("until", "replaced"), [(23.5, True), (60.0, False)])
def test_l4_message_that_was_under_way_is_no_replacement(until: float, replaced: bool) -> None:
    history = silent(good(), "effector/position", 20.05, until)
    history = succeeded(history, "kinematics", 23.0) if replaced else history
    finding = CHECKERS["L4"](faulty(history, InjectedFault("stop", "kinematics", 20.0, 35.0, 105)))
    assert (finding.verdict == VIOLATED) is not replaced
    assert finding.worst == pytest.approx(3.5 if replaced else math.inf, abs=0.1)


@pytest.mark.parametrize(("sent", "worst"), [(22.97, math.inf), (22.99, 2.991), (23.01, 3.011)])
def test_l4_process_may_be_noted_to_end_just_after_its_successor_sends(sent: float, worst: float) -> None:
    history = added(silent(good(), "effector/position", 20.0, END), "effector/position", (sent, (1.0, 0.0)))
    history = succeeded(history, "kinematics", 23.0)
    finding = CHECKERS["L4"](faulty(history, InjectedFault("stop", "kinematics", 20.0, 35.0, 105)))
    assert finding.worst == pytest.approx(worst)


def test_l4_successor_of_a_hung_sentinel_is_its_replacement() -> None:
    history = succeeded(silent(good(), "/diagnostics", 20.0, 23.5), "sentinel", 23.0)
    finding = CHECKERS["L4"](faulty(history, InjectedFault("stop", "sentinel", 20.0, 35.0, 111)))
    assert (finding.cases, finding.unknown) == (1, 0)


def test_percentiles_are_nearest_ranks() -> None:
    values = [float(n) for n in range(1, 101)]
    assert (percentile(values, 50), percentile(values, 99)) == (50.0, 99.0)
    assert math.isnan(percentile([], 50))
    assert value_at("l1", 0.0) == 2.0


def test_l1_constant_that_is_told_once_is_not_silent_for_good() -> None:
    first = [sample._replace(value=2.0) for sample in good().stream(topics.L1)[:1]]
    slow = InjectedFault("slow", "config_l1", 20.0, 21.0, 100)
    history = replace(good(), streams={**good().streams, "l1": first}, faults=[slow])
    assert not CHECKERS["L1"](history).evidence
    others = [each for each in history.stream(topics.DIAGNOSTICS) if each.value[0] != "config_l1"]
    mute = replace(history, streams={**history.streams, "/diagnostics": others})
    assert [each.text for each in CHECKERS["L1"](mute).evidence] == [
        "config_l1 is silent for 10 s after slow"
    ]


def test_l1_constant_of_successors_that_come_soon_is_not_silent_for_good() -> None:
    told = [Sample(at, at, 2.0) for at in (1.0, 1.5, 2.0)]
    slow = InjectedFault("slow", "config_l1", 20.0, 21.0, 100)
    history = replace(good(), streams={**good().streams, "l1": told}, faults=[slow])
    assert not CHECKERS["L1"](history).evidence


def test_l1_value_that_seldom_changes_is_not_silent_for_good() -> None:
    told = [Sample(at, at, at) for at in (1.0, 6.0, 11.0, 16.0)]
    slow = InjectedFault("slow", "config_l1", 20.0, 21.0, 100)
    history = replace(good(), streams={**good().streams, "l1": told}, faults=[slow])
    assert not CHECKERS["L1"](history).evidence


def test_l2_gap_of_a_stream_that_is_often_interrupted_is_not_usual() -> None:
    times = itertools.takewhile(lambda at: at < END, itertools.accumulate(itertools.cycle((0.1, 0.3, 0.3))))
    states = [Sample(at, at, ON) for at in times]
    history = replace(good(), streams={**good().streams, "engines/state": states})
    assert not CHECKERS["L2"](history).evidence


LATE = 0.002  # s


def slowed(history: History, topic: str, period: float) -> History:
    """Return the history in which a stream has another period, with a kill now and then."""
    kills = [InjectedFault("kill", "velocity", at, at) for at in (10.0, 20.1, 30.2, 40.3)]
    times = [step * period + (step % 3 == 0) * LATE for step in range(1, int(END / period))]
    values = history.streams[topic]
    samples = [Sample(t, t + 0.001, values[min(len(values) - 1, int(t))].value) for t in times]
    return replace(history, streams=history.streams | {topic: samples}, faults=kills)


def reporting(history: History, program: str, **parameters: float) -> History:
    """Return the history in which a service reports parameters."""
    return change(
        history,
        "/diagnostics",
        lambda s: s._replace(value=(*s.value, *parameters.items())) if s.value[0] == program else s,
    )


@pytest.mark.parametrize(
    ("topic", "program", "parameters"),
    [
        ("operator_heartbeat", "dead_mans_switch", {"rate": 4.0}),
        ("operator_heartbeat", "dead_mans_switch", {"rate": 1.0}),
        ("theta1", "config_theta1", {}),  # by the scenario
    ],
)
def test_l2_does_not_judge_a_stream_that_is_meant_to_be_slow(
    topic: str, program: str, parameters: dict[str, float]
) -> None:
    for period in (0.25, 0.3):
        history = reporting(slowed(good(), topic, period), program, **parameters)
        assert not [each for each in CHECKERS["L2"](history).evidence if program in each.text]


@pytest.mark.parametrize(
    ("topic", "program", "parameters"),
    [
        ("operator_heartbeat", "dead_mans_switch", {"rate": 20.0}),
        ("operator_heartbeat", "dead_mans_switch", {"rate": 5.0}),
        ("engines/state", "engine_controller", {"repeat": 0.2}),
        ("joint_states", "robot_state", {"rate": 5.0}),
        ("joint_states", "robot_state", {}),
        ("effector/position", "kinematics", {}),
    ],
)
def test_l2_finds_a_stream_that_is_slower_than_its_parameters_say(
    topic: str, program: str, parameters: dict[str, float]
) -> None:
    history = reporting(slowed(good(), topic, 0.3), program, **parameters)
    slow = f"{program} has a usual gap of 0.30 s"
    (found,) = (each for each in CHECKERS["L2"](history).evidence if each.text.startswith(slow))
    assert found.time == history.output(program)[0].sent


def test_l2_kinematics_is_as_fast_as_its_fastest_source() -> None:
    history = slowed(slowed(good(), "l2", 1.0), "effector/position", 0.3)
    text = "kinematics has a usual gap of 0.30 s instead of 0.04 s"
    assert text in [each.text for each in CHECKERS["L2"](history).evidence]


def test_l2_judges_a_stream_of_5_hz() -> None:
    history = slowed(good(), "theta1", 0.204)
    assert CHECKERS["L2"](history).verdict == HOLDS
    assert [each.text for each in CHECKERS["L2"](silent(history, "theta1", 20.1, 20.6)).evidence] == [
        "config_theta1 is silent for 0.61 s when velocity is killed"
    ]


def released(history: History, begin: float, end: float) -> History:
    """Return the history in which the plan lets go of the switch, whatever it sends."""
    return faulty(history, Condition("silence", begin, end))


def test_s1_switch_that_does_not_let_go_is_found() -> None:
    (evidence,) = CHECKERS["S1"](released(good(), 20.0, 40.0)).evidence
    assert evidence.text == "a heartbeat is sent 1.00 s after the operator has let go of the switch"
    hidden = faulty(released(good(), 20.0, 40.0), Condition("overload", 19.0, 25.0))
    assert [each.time for each in CHECKERS["S1"](hidden).evidence] == [25.05]
    late = silent(good(), "operator_heartbeat", 20.9, 40.0)  # the last ones were under way
    assert not CHECKERS["S1"](released(with_value(late, "engines/state", OFF, 25.0), 20.0, 40.0)).evidence


@pytest.mark.parametrize(
    "event",
    [
        InjectedFault("flood", NO_TARGET, 19.0, 45.0),
        InjectedFault("babble", NO_TARGET, 19.0, 45.0),
        Condition("overload", 19.0, 45.0),
    ],
)
def test_s1_heartbeats_of_others_are_no_switch_that_does_not_let_go(event: InjectedFault | Condition) -> None:
    assert not CHECKERS["S1"](faulty(released(good(), 20.0, 40.0), event)).evidence


def test_s1_stopped_switch_may_send_what_was_due() -> None:
    stopped = InjectedFault("stop", "dead_mans_switch", 19.0, 25.0, 100)
    history = silent(good(), "operator_heartbeat", 25.5, 45.0)
    history = with_value(history, "engines/state", OFF, 30.0)
    assert not CHECKERS["S1"](faulty(released(history, 20.0, 40.0), stopped)).evidence
    assert CHECKERS["S1"](released(history, 20.0, 40.0)).evidence


def test_what_excuses_violations_is_computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    computed: list[History] = []
    monkeypatch.setattr(promises, "effects", lambda history: computed.append(history) or effects(history))
    history = killed(good(), "kinematics", 20.0, 9.0)
    findings = [*promises.checked(history)]
    assert computed == [history]
    assert findings == [check(history) for check in CHECKERS.values()]
