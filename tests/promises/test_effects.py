from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from interfaces import topics
from tests.promises.effects import MISSED, Effect, Reason, disturbed_for, effects, undisturbed
from tests.promises.history import (
    ALL,
    CONTROLLER,
    DEPENDENTS,
    KINEMATICS,
    NO_TARGET,
    OPERATOR,
    ROBOT_STATE,
    SENTINEL,
    SOURCES,
    SWITCH,
    VELOCITY,
    WATCHDOG,
    Condition,
    History,
    InjectedFault,
    Life,
    Sample,
    programs_of_manifest,
)

from .histories import faulty

HEARTBEATS = {SWITCH, *DEPENDENTS[SWITCH]}
Row = tuple[set[str], float, float, str]


def rows(
    events: Sequence[InjectedFault | Condition] = (),
    lives: Sequence[Life] = (),
    *parameters: tuple[str, float],
) -> list[Row]:
    """Return the effects of faults, conditions and starts, in an arm with these parameters."""
    values = [Sample(float(second), float(second), 0.0) for second in range(101)]
    health = [Sample(0.0, 0.0, (program, 7, *parameters)) for program in (CONTROLLER, WATCHDOG)]
    streams = {**dict.fromkeys(topics.CONFIGURATION, values), "/diagnostics": health}
    return [
        ({*each.programs}, round(each.begin, 6), round(each.end, 6), each.why)
        for each in effects(faulty(History(100.0, streams, [*lives]), *events))
        if each.cause in (*events, *lives)
    ]


@pytest.mark.parametrize(
    ("kind", "target", "expected"),
    [
        ("kill", KINEMATICS, [({KINEMATICS, "velocity"}, 10.0, 16.0, Reason.SILENT)]),
        (
            "kill",
            "config_l1",
            [({"config_l1"}, 10.0, 16.0, Reason.SILENT), ({"config_l1"}, 9.98, 10.02, Reason.CUT_OFF)],
        ),
        ("kill", SENTINEL, [({SENTINEL}, 10.0, 16.0, Reason.SILENT), ({ALL}, 9.999, 14.0, Reason.UNWATCHED)]),
        ("kill_all", ALL, [({ALL}, 10.0, 19.0, Reason.SILENT), ({ALL}, 9.999, 14.0, Reason.UNWATCHED)]),
        ("crash_loop", "velocity", [({"velocity"}, 10.0, 19.0, Reason.SILENT)]),
        *(
            (
                kind,
                CONTROLLER,
                [({CONTROLLER}, 10.0, 19.0, Reason.SILENT), ({CONTROLLER}, 10.0, 14.0, Reason.SUSPENDED)],
            )
            for kind in ("stop", "pause", "hang", "hog", "slow")
        ),
        (
            "stop",
            WATCHDOG,
            [
                ({WATCHDOG, *DEPENDENTS[WATCHDOG]}, 10.0, 19.0, Reason.SILENT),
                ({WATCHDOG}, 10.0, 14.0, Reason.SUSPENDED),
                ({WATCHDOG}, 10.0, 14.0, Reason.DEAF),
            ],
        ),
        *(
            (
                kind,
                NO_TARGET,
                [({NO_TARGET}, 10.0, 16.0, Reason.SILENT), (HEARTBEATS, 10.0, 16.0, Reason.SILENT)],
            )
            for kind in ("flood", "babble")
        ),
        (
            "partition",
            OPERATOR,
            [
                ({OPERATOR, *HEARTBEATS}, 10.0, 24.0, Reason.SILENT),
                ({WATCHDOG}, 10.0, 24.0, Reason.DEAF),
            ],
        ),
        (
            "bad_line",
            ALL,
            [
                ({ALL}, 10.0, 16.0, Reason.SILENT),
                ({ALL}, 9.999, 14.0, Reason.UNWATCHED),
                ({ALL}, 10.0, 14.0, Reason.DELAYED),
            ],
        ),
        (
            "hold",
            "operator_heartbeat",
            [
                ({"operator_heartbeat"}, 10.0, 16.0, Reason.SILENT),
                ({WATCHDOG}, 10.0, 14.5, Reason.DEAF),
                ({WATCHDOG, *DEPENDENTS[WATCHDOG]}, 10.0, 16.0, Reason.SILENT),
            ],
        ),
        (
            "hold",
            "operator_presence",
            [
                ({"operator_presence"}, 10.0, 16.0, Reason.SILENT),
                ({CONTROLLER}, 10.0, 14.0, Reason.DEAF),
            ],
        ),
        (
            "lose",
            "engines",
            [({"engines"}, 10.0, 16.0, Reason.SILENT), ({WATCHDOG, CONTROLLER}, 10.0, 16.0, Reason.DELAYED)],
        ),
        ("lose", "theta1", [({"theta1"}, 10.0, 16.0, Reason.SILENT)]),
        (
            "rival",
            NO_TARGET,
            [({NO_TARGET}, 10.0, 16.0, Reason.SILENT), ({CONTROLLER}, 10.0, 24.0, Reason.OPPOSED)],
        ),
        (
            "step_clock",
            NO_TARGET,
            [
                ({NO_TARGET}, 10.0, 16.0, Reason.SILENT),
                ({WATCHDOG}, 10.0, 11.0, Reason.DEAF),
                ({ROBOT_STATE, VELOCITY}, 10.0, 11.15, Reason.STILL),
            ],
        ),
    ],
)
def test_effects_of_a_fault_from_10_to_14_s(kind: str, target: str, expected: list[Row]) -> None:
    assert rows([InjectedFault(kind, target, 10.0, 14.0)]) == expected


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("overload", ({ALL}, 10.0, 14.0, Reason.OVERLOADED)),
        ("loss", ({ALL}, 10.0, 14.0, Reason.LOST)),
        ("silence", ({OPERATOR, *HEARTBEATS}, 10.0, 16.0, Reason.SILENT)),
    ],
)
def test_effect_of_a_condition_from_10_to_14_s(kind: str, expected: Row) -> None:
    assert rows([Condition(kind, 10.0, 14.0)]) == [expected]


@pytest.mark.parametrize(
    ("kind", "target", "parameter", "ends"),
    [
        # the longest restart of the watchdog is a second shorter than the timeout
        ("crash_loop", WATCHDOG, ("presence_timeout", 7.0), []),
        ("crash_loop", WATCHDOG, ("presence_timeout", 6.875), [16.0]),
        ("kill_supervisor", ALL, ("presence_timeout", 6.875), [16.0]),
        ("kill", WATCHDOG, ("presence_timeout", 6.875), []),
        ("crash_loop", CONTROLLER, ("presence_timeout", 6.875), []),
        *(
            each
            for kind, target in (("flood", NO_TARGET), ("babble", NO_TARGET), ("bad_line", ALL))
            for each in ((kind, target, ("silence", 1.2), []), (kind, target, ("silence", 1.19), [16.0]))
        ),
    ],
)
def test_fault_from_10_to_14_s_keeps_heartbeats_from_the_watchdog_of_a_quick_arm(
    kind: str, target: str, parameter: tuple[str, float], ends: list[float]
) -> None:
    found = rows([InjectedFault(kind, target, 10.0, 14.0)], (), parameter)
    assert [row for row in found if row[-1] == Reason.DEAF] == [
        ({WATCHDOG}, 10.0, end, Reason.DEAF) for end in ends
    ]


def test_replaced_process_is_no_longer_suspended() -> None:
    lives = [Life(WATCHDOG, 7, 0.0, 12.0)]
    found = rows([InjectedFault("hang", WATCHDOG, 10.0, 25.0, 7)], lives)
    assert ({WATCHDOG}, 10.0, 12.0, Reason.SUSPENDED) in found
    assert ({WATCHDOG}, 10.0, 12.0, Reason.DEAF) in found
    assert ({WATCHDOG, *DEPENDENTS[WATCHDOG]}, 10.0, 17.0, Reason.SILENT) in found


@pytest.mark.parametrize(
    ("program", "expected"),
    [
        ("velocity", []),
        ("config_l1", [({"config_l1"}, 10.25, 11.0, Reason.UNDISCOVERED)]),
        (SWITCH, [({SWITCH}, 10.25, 13.25, Reason.UNDISCOVERED)]),
        (CONTROLLER, [({CONTROLLER}, 10.25, 10.27, Reason.REPLACED)]),
        (SENTINEL, [({*programs_of_manifest()} - {SENTINEL}, 10.25, 10.25, Reason.UNWATCHED)]),
    ],
)
def test_effects_of_a_start(program: str, expected: list[Row]) -> None:
    found = rows(lives=[Life(program, 7, 10.25, None)])
    assert found == [({program}, 10.25, 12.25, Reason.LATE_START), *expected]


@pytest.mark.parametrize("program", [SWITCH, CONTROLLER, SENTINEL])
def test_second_process_that_ends_before_the_first_replaces_nothing(program: str) -> None:
    found = rows(lives=[Life(program, 7, 0.0, None), Life(program, 8, 10.25, 11.0)])
    assert [row for row in found if row[1] > 10.0] == [({program}, 10.25, 12.25, Reason.LATE_START)]


def test_source_without_a_message_stays_undiscovered() -> None:
    (found,) = (
        each
        for each in effects(History(9.0, lives=[Life("config_l1", 7, 1.0, None)]))
        if each.why == Reason.UNDISCOVERED and "config_l2" not in each.programs
    )
    assert (found.begin, found.end) == (1.0, math.inf)


def test_silent_source_keeps_a_new_program_waiting() -> None:
    values = [Sample(at, at, 0.0) for at in (0.0, 1.2, 4.0)]  # the first pause is no silence
    flowing = [Sample(float(at), float(at), 0.0) for at in range(10)]
    streams = dict.fromkeys(topics.CONFIGURATION, flowing) | {"l1": values}
    history = History(9.0, streams)
    found = [each for each in effects(history) if each.why == Reason.WAITING and each.end < 9.0]
    assert [(each.begin, each.end) for each in found] == [
        (-math.inf, 0.0),
        (1.2, 4.0),
        *[(-math.inf, 0.0)] * 3,
    ]
    assert {*found[1].programs} == {KINEMATICS, ROBOT_STATE}


@pytest.mark.parametrize(
    ("lives", "faults", "since"),
    [
        ([], [], [11.0]),
        ([(0.0, None)], [], []),
        ([(0.0, 12.0)], [], [12.0]),
        ([(0.0, 7.0), (7.5, 12.0)], [], [12.0]),
        ([(0.0, 7.0), (13.0, None)], [], [11.0]),
        ([(0.0, None)], [("stop", "config_l1", 15.0)], [15.0]),
        ([(0.0, None)], [("stop", "config_l1", 3.0)], []),
        ([(0.0, None)], [("stop", "config_l2", 15.0)], []),
        ([(0.0, None)], [("double", "config_l1", 15.0)], []),
    ],
)
def test_source_gives_its_last_rare_value_to_new_programs_while_it_runs(
    lives: list[tuple[float, float | None]], faults: list[tuple[str, str, float]], since: list[float]
) -> None:
    rare = [Sample(at, at, 0.0) for at in (0.0, 5.0, 10.0, 11.0, 20.0)]
    flowing = [Sample(float(at), float(at), 0.0) for at in range(30)]
    history = History(
        30.0,
        dict.fromkeys(topics.CONFIGURATION, flowing) | {"l1": rare},
        [Life("config_l1", 7, *life) for life in lives],
        [InjectedFault(kind, target, begin, begin + 1.0) for kind, target, begin in faults],
    )
    found = [each for each in effects(history) if each.why == Reason.WAITING and each.end == 20.0]
    assert [each.begin for each in found] == since


def still(history: History) -> list[tuple[tuple[str, ...], float, float]]:
    """Return which programs have nothing to publish, and when."""
    found = (each for each in effects(history) if each.why == Reason.STILL)
    return [((*each.programs,), each.begin, each.end) for each in found]


def sent(*times: float) -> list[Sample]:
    return [Sample(at, at, 0.0) for at in times]


def test_kinematics_has_nothing_to_publish_while_all_sources_are_silent() -> None:
    history = History(9.0, {"l1": sent(1.0, 3.0), "theta2": sent(1.25, 2.0, 2.25)})
    times = [(-math.inf, 1.0), (1.25, 2.0), (2.25, 3.0), (3.0, math.inf)]
    assert still(history) == [((KINEMATICS,), *each) for each in times]


def test_velocity_has_nothing_to_publish_from_the_last_move_to_the_next_one() -> None:
    positions = {1.0: (0.0, 0.0), 1.25: (0.0, 1.0), 1.5: (0.0, 1.0), 2.5: (1.0, 1.0), 3.0: (1.0, 1.0)}
    stream = [Sample(at, at, value) for at, value in positions.items()]
    history = History(5.0, {"effector/position": stream, "l1": sent(*(at / 4 for at in range(21)))})
    found = [each for each in still(history) if each[0] != (KINEMATICS,)]
    assert found == [((VELOCITY,), 1.25, 2.5), ((VELOCITY,), 2.5, 5.0)]


def test_last_values_of_a_record_may_be_missing() -> None:
    (last,) = (each for each in effects(History(9.0)) if each.why == Reason.UNDISCOVERED)
    assert last == Effect(SOURCES, 8.9, math.inf, Reason.UNDISCOVERED, last.cause)


@pytest.mark.parametrize(
    ("begin", "end", "overlaps"),
    [(1.0, 2.0, False), (1.0, 2.5, True), (2.5, 3.0, True), (3.5, 5.0, True), (4.0, 5.0, False)],
)
def test_effect_disturbs_an_interval_with_which_it_has_time_in_common(
    begin: float, end: float, overlaps: bool
) -> None:
    effect = Effect((KINEMATICS,), 2.0, 4.0, Reason.DEAF, "a fault")
    assert undisturbed([effect], KINEMATICS, begin, end, Reason.DEAF) is not overlaps


def test_recovery_includes_its_ends() -> None:
    found = effects(History(99.0, faults=[InjectedFault("kill", "velocity", 10.0, 10.0)]))
    times = (8.0, 9.75), (8.0, 10.0), (12.0, 13.0), (12.25, 13.0)
    disturbed = [not undisturbed(found, "velocity", *each, Reason.SILENT) for each in times]
    assert disturbed == [False, True, True, False]


def test_effect_disturbs_only_its_programs_for_its_reason_and_not_its_cause() -> None:
    fault = InjectedFault("stop", KINEMATICS, 2.0, 4.0)
    one, every = (Effect((name,), 2.0, 4.0, Reason.DEAF, fault) for name in (KINEMATICS, ALL))
    assert not undisturbed([one], KINEMATICS, 1.0, 3.0, Reason.SILENT, Reason.DEAF)
    assert undisturbed([one], KINEMATICS, 1.0, 3.0, Reason.SILENT)
    assert undisturbed([one], "velocity", 1.0, 3.0, Reason.DEAF)
    assert not undisturbed([every], "velocity", 1.0, 3.0, Reason.DEAF)
    assert undisturbed([one, every], KINEMATICS, 1.0, 3.0, Reason.DEAF, but=fault)


def test_observer_misses_messages_by_overload_and_loss() -> None:
    conditions = [Condition("overload", 1.0, 3.0), Condition("loss", 5.0, 6.0)]
    stop = InjectedFault("stop", "velocity", 7.0, 8.0)
    found = effects(History(10.0, faults=[stop], conditions=conditions))
    assert disturbed_for(found, ALL, 2.0, 5.5, *MISSED) == 1.5
    assert disturbed_for(found, ALL, 0.0, 10.0, *MISSED) == 3.0
    assert undisturbed(found, ALL, 3.0, 5.0, *MISSED)
    assert not undisturbed(found, ALL, 2.5, 4.0, *MISSED)
    again = [Condition("overload", 2.0, 4.0), Condition("loss", 3.5, 4.5)]
    found = effects(History(10.0, conditions=[*conditions, *again]))
    assert disturbed_for(found, ALL, 0.0, 4.75, *MISSED) == 3.5
