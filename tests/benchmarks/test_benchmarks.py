"""The comparison with alternatives: its tables, its absent ones, and a very short measurement."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from deploy.supervision.processes import RUN_DIRECTORY
from deploy.supervision.rclpy_choice import sourced_rclpy
from tests.benchmarks import __main__ as command
from tests.benchmarks import alternatives, c_program, measurement, table
from tests.benchmarks.alternatives import Alternative
from tests.benchmarks.link import LAST, MIDDLE, SINK, Job
from tests.benchmarks.measurement import MeasurementFailed, Scenario


@pytest.mark.parametrize(
    ("rounds", "text"),
    [
        ([], "–"),
        ([0.1234], "0.12"),
        ([3.0, 1.0, 20.0], "3.00 (1.00–20.0)"),
        ([1234.5, 99.94], "667 (99.9–1,234)"),
    ],
)
def test_cell_is_the_median_with_the_extremes(rounds: list[float], text: str) -> None:
    assert table.cell(rounds) == text


def test_table_has_a_row_for_each_alternative_and_a_dash_without_figures() -> None:
    results = {"a": {"x": [2.0], "y": [3.0]}, "b": {"x": [4.0]}}

    assert table.table("t", results, {"x": "X", "y": "Y"}).splitlines() == [
        "| t | X | Y |",
        "|---|---:|---:|",
        "| a | 2.00 | 3.00 |",
        "| b | 4.00 | – |",
    ]


@pytest.mark.parametrize("rounds", ["0", "-1"])
def test_a_comparison_without_a_round_is_refused(rounds: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        command.main([f"--rounds={rounds}"])
    assert end.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1] == "make bench: error: --rounds must be at least 1"


def test_absent_alternatives_are_named_with_the_reason(capsys: pytest.CaptureFixture[str]) -> None:
    on_ros = bool(sourced_rclpy())
    here = Alternative("here", "callbacks", ros=on_ros)
    unknown = Alternative("unknown", "nothing", ros=on_ros)

    assert command.present([here, unknown]) == [here]

    assert capsys.readouterr().out == (
        "absent: unknown: ModuleNotFoundError: No module named 'tests.benchmarks.links.nothing'\n"
    )


def test_no_rclpy_is_measured_as_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    here = Alternative("here", "callbacks", ros=bool(sourced_rclpy()))
    other = Alternative("other", "callbacks", ros=not here.ros)
    monkeypatch.setattr(Alternative, "environment", here.environment)
    expected = "Cyclone DDS" if other.ros else "the middleware of ROS 2"
    assert other.missing() == f"rclpy stands on {expected} here"


def test_failed_measurement_leaves_the_others_their_figures(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def measure(alternative: Alternative, scenario: Scenario) -> dict[str, float]:
        if alternative.title == "silent":
            raise MeasurementFailed("no word")
        return {"x": 1.0}

    monkeypatch.setattr(command, "measure", measure)
    silent, good = Alternative("silent", "callbacks"), Alternative("good", "callbacks")

    rounds = command.compare([silent, good], [Scenario("start", 8, 0.0)], 2)

    assert list(rounds) == [("good", {"x": 1.0})] * 2
    assert "no figures: silent, start.8: no word\n" in capsys.readouterr().out


def test_each_round_measures_all_in_an_order_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "measure", lambda alternative, scenario: {})
    monkeypatch.setattr(command, "random", random.Random(1))
    compared = [Alternative(title, "callbacks") for title in "abcdef"]

    titles = [title for title, _ in command.compare(compared, [Scenario("start", 8, 0.0)], 3)]

    rounds = [titles[:6], titles[6:12], titles[12:]]
    assert [sorted(each) for each in rounds] == [list("abcdef")] * 3
    assert len({tuple(each) for each in rounds}) == 3


def test_processor_time_of_a_process_is_that_of_all_its_threads() -> None:
    end = time.process_time() + 0.05
    while time.process_time() < end:
        pass

    assert measurement.cpu_seconds(0) == pytest.approx(time.process_time(), abs=0.01)


def assert_has_figures(figures: dict[str, float], key: str) -> None:
    """Fail unless these are the figures of a measurement with a latency, all above zero."""
    names = ("p50_ms", "p99_ms", "cpu_us", "megabytes", "threads", "delivered")
    assert set(figures) == {f"{key}.{name}" for name in names}
    assert all(value > 0 for value in figures.values())


def test_short_pipeline_of_this_system_has_figures() -> None:
    here = Alternative("ReactiveNode", "reactive", ros=bool(sourced_rclpy()))

    figures = measurement.measure(here, Scenario("pipeline", 8, 200.0, warm_up=0.1, seconds=0.2))

    assert_has_figures(figures, "pipeline.8")


def test_middle_process_or_sink_is_charged() -> None:
    assert Scenario("flood", 1_000_000, 0.0).charged == (SINK,)
    assert Scenario("pipeline", 1_000_000, 20.0).charged == (MIDDLE,)


def test_c_program_has_the_settings_of_the_runtime(tmp_path: Path) -> None:
    job = Job(c_program.PIPELINE, SINK, LAST, 8, 0.0, 0.0, 1.0, str(tmp_path))
    ((*_, settings),) = alternatives.c_processes(Alternative("C", c_program.PIPELINE), [job])
    assert "FragmentSize" in settings


@pytest.mark.parametrize("link", ["chain", "chain_services", "chain_operators"])
def test_short_chain_has_figures(link: str) -> None:
    here = Alternative("here", link, ros=bool(sourced_rclpy()))

    figures = measurement.measure(here, Scenario("chain", 8, 100.0, warm_up=0.1, seconds=0.3))

    assert_has_figures(figures, "chain.100")
    assert figures["chain.100.p50_ms"] < 1000 / 100, "the latency is that of the latest angle"


def test_missing_compiler_is_named_with_its_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    assert c_program.build() == "apt-get install gcc libc6-dev cyclonedds-tools cyclonedds-dev"


def test_programs_are_built_apart_from_other_builds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(RUN_DIRECTORY, str(tmp_path))
    if reason := c_program.build():
        pytest.skip(reason)
    built = {path.name for path in (tmp_path / "bench" / "c").iterdir()}
    assert built == {c_program.PIPELINE, c_program.SERVICES}


@pytest.fixture(scope="module")
def in_c() -> Callable[[str], Alternative]:
    if reason := c_program.build():
        pytest.skip(reason)
    return lambda name: Alternative("C", name, commands=alternatives.c_processes)


@pytest.mark.parametrize(
    ("program", "scenario"),
    [
        (c_program.PIPELINE, Scenario("pipeline", 1_000_000, 50.0, warm_up=0.1, seconds=0.2)),
        (c_program.SERVICES, Scenario("chain", 8, 100.0, warm_up=0.1, seconds=0.2)),
        (c_program.SERVICES, Scenario("watchdog", 1, 1000.0, warm_up=0.2, seconds=0.4)),
    ],
    ids=lambda value: value if isinstance(value, str) else value.name,
)
def test_short_measurement_of_the_c_program_has_figures(
    in_c: Callable[[str], Alternative], program: str, scenario: Scenario
) -> None:
    figures = measurement.measure(in_c(program), scenario)
    assert all(value > 0 for value in figures.values())


def test_processor_time_is_measured_although_all_reports_have_waited(monkeypatch: pytest.MonkeyPatch) -> None:
    report = measurement._Run.report

    def late(run: Any, role: str, event: str, count: int = 1) -> dict[str, Any]:
        if event == "begin":
            report(run, role, "end")  # the machine stood still for the whole measurement
        return report(run, role, event, count)

    monkeypatch.setattr(measurement._Run, "report", late)
    here = Alternative("callbacks", "callbacks", ros=bool(sourced_rclpy()))
    figures = measurement.measure(here, Scenario("pipeline", 8, 200.0, warm_up=0.1, seconds=0.2))
    assert figures["pipeline.8.cpu_us"] > 10.0


def test_process_that_ends_early_is_one_line() -> None:
    with pytest.raises(MeasurementFailed, match="No module named"):
        measurement.measure(Alternative("x", "nothing"), Scenario("start", 8, 0.0))
