"""The cost of many arms and many subscribers: a very short measurement of each."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest

from deploy.supervision.rclpy_choice import sourced_rclpy
from deploy.supervision.system import System
from tests.benchmarks import __main__ as command
from tests.benchmarks import measurement, scale
from tests.benchmarks.alternatives import Alternative
from tests.benchmarks.measurement import MeasurementFailed
from tests.chaos.arm import RealArm
from tests.chaos.cost import Cost

pytestmark = pytest.mark.timeout(120)


def test_fleet_of_two_has_a_cost_and_leaves_nothing(tmp_path: Path) -> None:
    with scale.Fleet(tmp_path, shared=False) as fleet:
        fleet.start()
        fleet.start()
        assert {arm.system.environment()["REACTIVE_ARM_NAMESPACE"] for arm in fleet.arms} == {
            "/arm1",
            "/arm2",
        }
        domains = {arm.system.environment()["ROS_DOMAIN_ID"] for arm in fleet.arms}
        figures = fleet.cost(1.0) | {"restart": fleet.restart()}
        assert all(arm.system.members() for arm in fleet.arms)
    assert len(domains) == 2
    assert figures.keys() == scale.HEADINGS[scale.OWN_DOMAINS].keys() - {"started", "last_start"}
    assert all(value > 0 for value in figures.values())
    assert [arm.system.members() for arm in fleet.arms] == [[], []]


def test_arms_may_share_a_domain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scale, "LAUNCH", ["sh", "-c", f"echo $ROS_DOMAIN_ID >> {tmp_path}/started"])
    with scale.Fleet(tmp_path / "fleet", shared=True) as fleet:
        fleet.start()
        fleet.start()
    started = (tmp_path / "started").read_text().split()
    assert len(started) == 2
    assert len(set(started)) == 1


def test_arm_that_does_not_start_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scale, "LAUNCH", ["sh", "-c", "echo no room >&2; echo more >&2; exit 1"])
    with (
        scale.Fleet(tmp_path, shared=True) as fleet,
        pytest.raises(MeasurementFailed, match=r"^arm 1 does not start: no room$"),
    ):
        fleet.start()


def test_cost_is_that_of_one_arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    costs = iter([Cost(100.0, 7.0, 2, 26, 0.0, 0), Cost(110.0, 9.0, 2, 26, 400.0, 0)])
    packets = iter([1_000, 5_000])
    monkeypatch.setattr(scale, "Cost", mock.Mock(now=lambda arms: next(costs)))
    monkeypatch.setattr(scale, "_packets", lambda: next(packets))
    fleet = scale.Fleet(tmp_path, shared=True)
    fleet.arms = [RealArm("/arm1", System(tmp_path)), RealArm("/arm2", System(tmp_path))]
    assert fleet.cost(0.0) == {"cpu": 10.0, "megabytes": 200.0, "packets": 200.0}


def test_fleet_grows_until_the_machine_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scale, "SETTLE", 0.0)
    monkeypatch.setattr(scale.os, "sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr(scale.Fleet, "start", lambda self: self.arms.append(None))
    monkeypatch.setattr(scale.Fleet, "cost", lambda self: {"cpu": 20.0})
    monkeypatch.setattr(scale.Fleet, "restart", lambda self: 0.5)
    rows = scale.fleet(shared=False, sizes=(1, 5, 10, 20))
    numbers: list[str] = []
    with pytest.raises(MeasurementFailed, match="full with 10 arms"):
        numbers.extend(number for number, _ in rows)
    assert numbers == ["1", "5", "10"]


def test_item_costs_its_publisher_and_its_subscribers() -> None:
    here = Alternative("ReactiveNode", "reactive", ros=bool(sourced_rclpy()))
    scenario = measurement.Scenario("subscribers", 8, 200.0, warm_up=0.2, seconds=0.3)
    figures = measurement.measure_subscribers(here, scenario, 3)
    assert figures.keys() == scale.HEADINGS[scale.SUBSCRIBERS].keys()
    assert all(value > 0 for value in figures.values())


def test_kinds_are_measured_one_after_the_other(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fleet(*, shared: bool) -> Iterator[tuple[str, dict[str, float]]]:
        yield "1", {"started": 2.0, "cpu": 9.0 + shared}
        raise MeasurementFailed("arm 2 does not start")

    monkeypatch.setattr(scale, "fleet", fleet)
    monkeypatch.setattr(scale, "subscribers", lambda: iter([("5", {"publisher_us": 30.0})]))
    results: dict[str, dict[str, dict[str, list[float]]]] = {}
    command.collect_scale(results)
    assert results == {
        scale.OWN_DOMAINS: {"1": {"started": [2.0], "cpu": [9.0]}},
        scale.ONE_DOMAIN: {"1": {"started": [2.0], "cpu": [10.0]}},
        scale.SUBSCRIBERS: {"5": {"publisher_us": [30.0]}},
    }
    assert f"{scale.ONE_DOMAIN}: arm 2 does not start\n" in capsys.readouterr().out
    assert "| 5 | 30.0 | – |" in scale.tables(results)
