"""The figures of signals that do not depend on the machine meet their goals."""

from __future__ import annotations

from tests.benchmarks import signals


def test_all_questions_are_answered() -> None:
    name, goal, measured, notes = signals.mix(30.0)

    assert (name, goal, measured) == (signals.MIX, "100 % answered", "100.0%")
    assert "longest 1" in notes  # 100 ms for late samples, and the next sample


def test_linear_motion_is_exact() -> None:
    assert float(signals.line(10.0)[2]) <= 1e-9


def test_disorder_and_replay_change_no_byte() -> None:
    _, _, measured, notes = signals.hour(60.0)

    assert measured == "the same"
    assert notes != "with 0 samples later than their bound, the replay has the bytes of the run"


def test_memory_is_measured_over_the_hours() -> None:
    _, goal, measured, notes = signals.day(hours=2, rate=1.0)

    assert (goal, measured[-3:]) == ("flat", " MB")
    assert notes.endswith("28,800 samples")


def test_demo_is_as_fast_as_its_scenario_says() -> None:
    speeds = [signals.true_speed(k / 100) for k in range(2000)]

    assert 2.5 < max(speeds) < 3.0
    assert min(speeds) == 0.0


def test_table_has_a_row_for_each_figure() -> None:
    assert signals.table({"a": ["1", "2", "x"], "b": ["3", "4", ""]}) == (
        "| | goal | measured | notes |\n|---|---|---|---|\n| a | 1 | 2 | x |\n| b | 3 | 4 |  |"
    )
