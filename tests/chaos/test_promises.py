"""The promises of the design, on what a monkey does to real systems; `make chaos` does it longer.

Two arms are played with at once where each leaves the processor idle; the flood of the other play would take
it from a second arm's services.
"""

from __future__ import annotations

import pytest

from deploy.chaos.findings import HOLDS, UNKNOWN
from deploy.chaos.history import PROGRAMS, SILENCE, between
from deploy.chaos.promises import CHECKERS
from deploy.chaos.safety import ABSENCE, OFF_WITHIN, SAMPLING, TRANSPORT, running
from interfaces.topics import DRIVE_TIMEOUT, EFFECTOR_POSITION, ENGINES, OPERATOR_HEARTBEAT

from .plays import Play, play, unleash

ARMS = ("/arm1", "/arm2")
PLAYS = (*(f"briefly {namespace}" for namespace in ARMS), "variously")
pytestmark = pytest.mark.timeout(420)


@pytest.fixture(scope="module")
def plays(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Play]:
    """What came of each play, for each arm."""
    run = tmp_path_factory.mktemp("briefly")
    end = unleash(run, "--scenario", "briefly", "--arms", "2")
    fleet = {f"briefly {namespace}": Play(run, *end, namespace) for namespace in ARMS}
    return fleet | {"variously": play(tmp_path_factory.mktemp("variously"), "--scenario", "variously")}


def asleep(play: Play) -> tuple[float, float]:
    """When the operator was there for the last time before he slept, and when the engines stopped."""
    history = play.history
    sleep = next(fault for fault in history.faults if fault.kind == SILENCE and fault.begin > 0.0)
    begin = between(history.stream(OPERATOR_HEARTBEAT), 0.0, sleep.begin + 1.0)[-1].sent
    return begin, max(off for on, off in running(history) if on < sleep.end)


@pytest.mark.parametrize("name", PLAYS)
@pytest.mark.parametrize("promise", CHECKERS)
def test_no_promise_is_broken(plays: dict[str, Play], name: str, promise: str) -> None:
    assert plays[name].finding(promise).verdict in (HOLDS, UNKNOWN)


@pytest.mark.parametrize("namespace", ARMS)
def test_no_arm_of_a_fleet_ends_before_its_record(plays: dict[str, Play], namespace: str) -> None:
    history = plays[f"briefly {namespace}"].history
    assert history.end - history.stream(EFFECTOR_POSITION)[-1].sent < 1.0


@pytest.mark.parametrize("promise", CHECKERS)
def test_every_promise_is_put_to_the_test(plays: dict[str, Play], promise: str) -> None:
    assert sum(play.finding(promise).cases for play in plays.values()) > 0


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_killed_program_is_back_within_two_seconds(plays: dict[str, Play], program: str) -> None:
    assert max(plays["briefly /arm1"].finding("L1").times[program]) <= 2.0


def test_engines_go_off_in_time_though_the_watchdog_is_killed_every_two_seconds(
    plays: dict[str, Play],
) -> None:
    play = plays["briefly /arm1"]
    begin, off = asleep(play)
    assert not between(play.history.stream(ENGINES), begin, off)  # the watchdog never came to commanding it
    assert ABSENCE - SAMPLING - TRANSPORT < off - begin <= OFF_WITHIN


def test_engines_go_off_in_time_though_the_controller_is_stopped(plays: dict[str, Play]) -> None:
    play = plays["variously"]
    begin, off = asleep(play)
    stop = next(f for f in play.history.faults if (f.kind, f.target) == ("stop", "engine_controller"))
    assert stop.begin < off <= stop.begin + DRIVE_TIMEOUT + TRANSPORT  # of itself, as nobody said so
    assert not between(play.history.stream(ENGINES), begin, off)
    assert off - begin <= OFF_WITHIN


def test_a_hung_kinematics_a_stopped_source_and_a_stopped_sentinel_are_replaced(
    plays: dict[str, Play],
) -> None:
    assert set(plays["variously"].finding("L4").times) == {"kinematics", "config_l1", "sentinel"}


def test_supervisord_is_killed_and_nothing_lives_twice_afterwards(plays: dict[str, Play]) -> None:
    play = plays["variously"]
    supervisors = [life for life in play.history.lives if not life.program]
    assert len(supervisors) == 2
    assert play.finding("S5").cases >= len(PROGRAMS)


@pytest.mark.parametrize("name", PLAYS)
def test_in_the_end_everything_flows(plays: dict[str, Play], name: str) -> None:
    history = plays[name].history
    silent = {p for p in PROGRAMS if history.output(p)[-1].received < history.end - 3.0}
    assert not silent


@pytest.mark.parametrize("name", PLAYS)
def test_the_exit_code_and_the_page_tell_the_verdict(plays: dict[str, Play], name: str) -> None:
    play = plays[name]
    assert play.code == 0, play.output
    page = play.page.read_text(encoding="utf-8")
    assert "All promises hold" in page
    assert page.count("<svg") >= 2
    assert not any(word in page for word in ("http:", "https:", "src="))


def test_what_a_fleet_costs_and_how_it_ended_is_told(plays: dict[str, Play]) -> None:
    output = plays["briefly /arm1"].output
    assert ") in 11 processes an arm" in output
    assert output.endswith("2 arms: no promise is broken\n")
