"""The promises of the design, checked in three experiments with real systems; `make chaos` runs longer ones.

The first two take most of two cores, so only the third one, with few faults, has two arms at once.
"""

from __future__ import annotations

import pytest

from deploy.chaos.findings import HOLDS, UNKNOWN
from deploy.chaos.history import PROGRAMS, SILENCE, between
from deploy.chaos.promises import CHECKERS
from deploy.chaos.safety import OFF_WITHIN, PRESENCE_TIMEOUT, SAMPLING, TRANSPORT, running
from interfaces.topics import DRIVE_TIMEOUT, EFFECTOR_POSITION, ENGINES, OPERATOR_HEARTBEAT

from .experiments import Experiment, experiment, unleash

ARMS = ("/arm1", "/arm2")
FLEET = tuple(f"fleet {namespace}" for namespace in ARMS)
EXPERIMENTS = ("briefly", "variously", *FLEET)
pytestmark = pytest.mark.timeout(420)


@pytest.fixture(scope="module")
def experiments(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Experiment]:
    """The result of each experiment, for each arm."""
    results = {
        name: experiment(tmp_path_factory.mktemp(name), "--scenario", name)
        for name in ("briefly", "variously")
    }
    run = tmp_path_factory.mktemp("fleet")
    end = unleash(run, "--scenario", "kill_controller", "--arms", str(len(ARMS)))
    return results | {f"fleet {namespace}": Experiment(run, *end, namespace) for namespace in ARMS}


def asleep(result: Experiment) -> tuple[float, float]:
    """Return the last sign of life before the operator slept, and when the engines stopped."""
    history = result.history
    sleep = next(fault for fault in history.faults if fault.kind == SILENCE and fault.begin > 0.0)
    begin = between(history.stream(OPERATOR_HEARTBEAT), 0.0, sleep.begin + 1.0)[-1].sent
    return begin, max(off for on, off in running(history) if on < sleep.end)


@pytest.mark.parametrize("name", EXPERIMENTS)
@pytest.mark.parametrize("promise", CHECKERS)
def test_no_promise_is_violated(experiments: dict[str, Experiment], name: str, promise: str) -> None:
    assert experiments[name].finding(promise).verdict in (HOLDS, UNKNOWN)


@pytest.mark.parametrize("name", FLEET)
def test_each_arm_runs_until_its_record_ends(experiments: dict[str, Experiment], name: str) -> None:
    history = experiments[name].history
    assert history.end - history.stream(EFFECTOR_POSITION)[-1].sent < 1.0


@pytest.mark.parametrize("promise", CHECKERS)
def test_every_promise_is_exercised(experiments: dict[str, Experiment], promise: str) -> None:
    assert sum(result.finding(promise).cases for result in experiments.values()) > 0


@pytest.mark.parametrize("program", PROGRAMS)
def test_killed_program_is_back_within_two_seconds(experiments: dict[str, Experiment], program: str) -> None:
    assert max(experiments["briefly"].finding("L1").times[program]) <= 2.0


def test_killing_the_watchdog_every_2_s_does_not_delay_turn_off(
    experiments: dict[str, Experiment],
) -> None:
    result = experiments["briefly"]
    begin, off = asleep(result)
    assert not between(result.history.stream(ENGINES), begin, off)  # the watchdog never commands it
    assert PRESENCE_TIMEOUT - SAMPLING - TRANSPORT < off - begin <= OFF_WITHIN


def test_engines_turn_off_in_time_with_a_stopped_controller(experiments: dict[str, Experiment]) -> None:
    result = experiments["variously"]
    begin, off = asleep(result)
    stop = next(f for f in result.history.faults if (f.kind, f.target) == ("stop", "engine_controller"))
    assert stop.begin < off <= stop.begin + DRIVE_TIMEOUT + TRANSPORT  # by the drive, without a command
    assert not between(result.history.stream(ENGINES), begin, off)
    assert off - begin <= OFF_WITHIN


def test_hung_programs_and_a_stopped_sentinel_are_replaced(
    experiments: dict[str, Experiment],
) -> None:
    assert set(experiments["variously"].finding("L4").times) == {"kinematics", "config_l1", "sentinel"}


def test_killed_supervisord_leaves_no_second_instance(experiments: dict[str, Experiment]) -> None:
    result = experiments["variously"]
    supervisors = [life for life in result.history.lives if not life.program]
    assert len(supervisors) == 2
    assert result.finding("S5").cases >= len(PROGRAMS)


@pytest.mark.parametrize("name", ["briefly", "variously"])  # a fleet ends while the operator sleeps
def test_every_output_flows_at_the_end(experiments: dict[str, Experiment], name: str) -> None:
    history = experiments[name].history
    silent = {p for p in PROGRAMS if history.output(p)[-1].received < history.end - 3.0}
    assert not silent


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_exit_code_and_page_show_the_verdict(experiments: dict[str, Experiment], name: str) -> None:
    result = experiments[name]
    assert result.code == 0, result.output
    page = result.page.read_text(encoding="utf-8")
    assert "All exercised promises hold" in page
    assert page.count("<svg") >= 2
    page = page.replace("http://www.w3.org/2000/svg", "")  # a name, not an address
    assert not any(word in page for word in ("http:", "https:", "src="))


def test_output_shows_cost_and_verdict_of_a_fleet(experiments: dict[str, Experiment]) -> None:
    output = experiments[FLEET[0]].output
    assert f") in {len(PROGRAMS) + 1} processes per arm" in output
    assert output.endswith("2 arms: no promise is violated\n")
