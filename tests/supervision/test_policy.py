from __future__ import annotations

from collections.abc import Iterable

import pytest

from deploy.supervision.manifest import SENTINEL
from deploy.supervision.policy import RECENT, Action, Observation, Policy, Timeouts
from deploy.supervision.processes import Process
from deploy.supervision.supervisord import Program

TIMEOUTS = Timeouts(period=0.25, health=2.5)  # times without rounding
PIDS = {name: 100 + index for index, name in enumerate(("a", "b", "c", "d", "e", SENTINEL))}


def program(name: str, state: str = "RUNNING", uptime: float = 0.0, restarts: int = 0) -> Program:
    return Program(name, state, PIDS[name], uptime, restarts, "", "")


class Run:
    def __init__(self, *programs: Program) -> None:
        self.policy = Policy(TIMEOUTS)
        self.programs = {each.name: each for each in programs}
        self.now = 0.0
        self.last_health: dict[tuple[str, int], float] = {}

    def hear(self, names: Iterable[str]) -> None:
        for name in names:
            self.last_health[name, self.programs[name].pid] = self.now

    def decide(self, *, stopped: Iterable[str] = (), duplicates: Iterable[Process] = ()) -> list[Action]:
        return self.policy.decide(
            Observation(
                self.now,
                [*self.programs.values()],
                dict(self.last_health),
                frozenset(PIDS[name] for name in stopped),
                frozenset(duplicates),
            )
        )

    def first(
        self, until: float, healthy: Iterable[str] = (), **seen: Iterable[str]
    ) -> tuple[float, list[Action]]:
        """Observe until there are actions; return when, and the actions."""
        while self.now <= until:
            self.hear(healthy)
            if actions := self.decide(**seen):  # type: ignore[arg-type]
                return self.now, actions
            self.now += TIMEOUTS.period
        return self.now, []


def silence_of(seconds: float, name: str) -> Action:
    return Action("kill", name, PIDS[name], f"no health for {seconds:.1f} s")


def test_nothing_is_inhibited_before_and_after_a_good_observation() -> None:
    policy = Policy()
    assert policy.kill_inhibited_by == ""
    assert policy.hears_itself is True
    assert policy.decide(Observation(0.0, [program("a")])) == []
    assert policy.kill_inhibited_by == ""
    assert policy.recent_restarts == {"a": 0}
    assert policy.reasons == {}


def test_silent_program_is_killed_at_the_timeout_and_the_reason_kept() -> None:
    run = Run(program("a"), program("b"))
    run.hear("ab")

    assert run.first(9.0, healthy="b") == (2.5, [silence_of(2.5, "a")])
    assert run.policy.reasons == {"a": "no health for 2.5 s"}


@pytest.mark.parametrize("state", ["STARTING", "RUNNING"])
def test_stopped_program_is_killed_at_the_timeout(state: str) -> None:
    run = Run(program("a", state))

    assert run.first(9.0, stopped="a") == (
        2.5,
        [Action("kill", "a", PIDS["a"], "stopped for 2.5 s")],
    )


def test_stop_counts_from_its_observation() -> None:
    run = Run(program("a"))
    run.now = 5.0
    run.hear("a")

    assert run.first(9.0, stopped="a") == (
        7.5,
        [Action("kill", "a", PIDS["a"], "stopped for 2.5 s")],
    )


def test_duplicate_is_killed_at_the_timeout() -> None:
    run = Run(program("a"))
    run.now = 5.0
    duplicate = Process(777, "a")

    assert run.first(9.0, duplicates=[duplicate]) == (
        6.0,
        [Action("kill", "a", 777, "process 777 was a duplicate")],
    )


@pytest.mark.parametrize(("uptime", "start"), [(0.0, 10.0), (4.0, 6.0), (5.0, 5.0), (300.0, 5.0)])
def test_first_health_may_take_the_start_timeout_less_the_uptime(uptime: float, start: float) -> None:
    run = Run(program("a", uptime=uptime))

    assert run.first(11.0) == (start, [silence_of(start, "a")])


@pytest.mark.parametrize(("silent", "of"), [("a", "a"), ("a", "ab"), ("ab", "abcd"), ("ab", "abcde")])
def test_half_of_the_services_or_a_single_one_are_killed(silent: str, of: str) -> None:
    run = Run(*(program(name) for name in of))
    run.hear(of)

    when, actions = run.first(9.0, healthy=sorted(set(of) - set(silent)))

    assert (when, actions) == (2.5, [silence_of(2.5, name) for name in silent])
    assert run.policy.kill_inhibited_by == ""


def test_more_than_half_of_the_services_are_spared() -> None:
    run = Run(*(program(name) for name in "abc"))
    run.hear("abc")

    assert run.first(9.0, healthy="c")[1] == []
    assert run.policy.kill_inhibited_by == "2 of 3 services are silent at once"


def test_services_that_fall_silent_within_one_period_are_spared() -> None:
    run = Run(*(program(name) for name in "abcd"))
    last = {0.0: "a", 0.5: "b", 1.0: "cd"}  # the last reports before the network fails
    while run.now <= 1.0:
        run.hear(last.get(run.now, ""))
        assert run.decide() == []
        run.now += TIMEOUTS.period

    assert run.first(30.0)[1] == []
    assert run.policy.kill_inhibited_by == "4 of 4 services are silent at once"


def test_service_that_does_not_return_with_most_has_the_start_timeout() -> None:
    run = Run(*(program(name) for name in "abcde"))
    run.hear("abcde")
    assert run.first(20.0)[1] == []
    returned = run.now

    assert run.first(returned + 9.0, healthy="abc")[1] == []
    assert run.policy.kill_inhibited_by == ""
    assert run.first(60.0, healthy="abcd") == (
        returned - 0.25 + 10.0,  # from the last time that most were silent
        [silence_of(returned - 0.25 + 10.0, "e")],
    )


def test_service_that_has_returned_with_most_is_killed_at_the_timeout() -> None:
    run = Run(*(program(name) for name in "abc"))
    run.hear("abc")
    assert run.first(20.0)[1] == []
    run.hear("abc")
    returned = run.now

    assert run.first(40.0, healthy="ab") == (returned + 2.5, [silence_of(2.5, "c")])


def test_service_whose_first_health_is_not_due_is_not_expected() -> None:
    run = Run(*(program(name) for name in "abc"))
    run.now = 20.0
    run.hear("abc")
    assert run.first(40.0, healthy="abc")[1] == []
    run.programs |= {"d": program("d"), "e": program("e")}  # new ones

    assert run.first(43.0, healthy="c")[1] == []
    assert run.policy.kill_inhibited_by == "2 of 3 services are silent at once"


def test_service_is_expected_from_the_moment_its_first_health_is_due() -> None:
    run = Run(*(program(name) for name in "abc"))
    assert run.first(7.5, healthy="ac")[1] == []
    run.now = 7.5
    run.hear("ac")
    while run.now < 10.0:
        run.hear("c")
        assert run.decide() == []
        run.now += 0.25

    assert run.decide() == []
    assert run.policy.kill_inhibited_by == "2 of 3 services are silent at once"


def test_deaf_sentinel_ends_itself_at_the_start_timeout() -> None:
    run = Run(program(SENTINEL), program("a"))
    run.hear([SENTINEL, "a"])

    when, actions = run.first(20.0, healthy="a")

    assert (when, actions) == (12.5, [silence_of(12.5, SENTINEL)])


def test_sentinel_that_heard_itself_can_be_deaf_again() -> None:
    run = Run(program(SENTINEL), program("a"))
    run.hear([SENTINEL, "a"])
    assert run.first(12.0, healthy="a")[1] == []
    run.hear([SENTINEL, "a"])
    heard = run.now

    assert run.first(40.0, healthy="a")[0] == heard + 12.5


def test_pauses_of_the_sentinel_count_for_no_silence() -> None:
    run = Run(program("a"), program("b"))
    run.hear("ab")
    assert run.decide() == []
    for _ in range(2):
        run.now += 30.0
        run.hear("ab")
        assert run.decide() == []
    run.now += 30.0
    assert run.decide() == []  # own time has advanced by one period
    resumed = run.now

    assert run.first(200.0, healthy="b") == (resumed + 2.25, [silence_of(2.5, "a")])


def test_restarts_within_a_minute_are_recent() -> None:
    run = Run(program("a", restarts=4))
    recent = []
    for now, restarts in ((0.0, 4), (10.0, 5), (20.0, 6), (69.5, 6), (70.0, 6), (79.5, 6), (80.0, 6)):
        run.policy._last_time = None  # observed all the time
        run.now = now
        run.programs["a"] = program("a", restarts=restarts)
        run.hear("a")
        run.decide()
        recent.append(run.policy.recent_restarts["a"])

    assert RECENT == 60.0
    assert recent == [0, 1, 2, 2, 1, 1, 0]


def test_fewer_restarts_after_a_new_supervisord_are_none() -> None:
    run = Run(program("a", restarts=4))
    run.decide()
    run.programs["a"] = program("a", restarts=1)
    run.decide()

    assert run.policy.recent_restarts == {"a": 0}


def test_revival_waits_twice_as_long_each_time_up_to_the_longest() -> None:
    run = Run(program("a", "FATAL"))
    delays = []
    for _ in range(8):
        begin = run.now
        when, actions = run.first(1000.0)
        delay = when - begin
        assert actions == [Action("revive", "a", 0, f"FATAL; revived after {delay:g} s")]
        delays.append(delay)
        run.now += 0.25
    assert delays == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 60.0, 60.0]


def test_program_is_revived_however_often_it_was_in_vain() -> None:
    policy = Policy(Timeouts(first_revival=0.25, longest_revival=0.25))
    observations = (Observation(0.25 * number, [program("a", "FATAL")]) for number in range(2200))

    assert sum(len(policy.decide(each)) for each in observations) == 1100  # 2.0**1024 overflows


def test_program_started_by_hand_in_vain_waits_its_whole_delay_again() -> None:
    run = Run(program("a", "FATAL"))
    run.now = 0.5
    assert run.decide() == []
    run.programs["a"] = program("a", "STARTING")
    assert run.decide() == []
    run.programs["a"] = program("a", "FATAL")
    run.now = 5.0

    assert run.first(9.0)[0] == 6.0


def test_program_that_ran_again_is_revived_after_the_first_delay() -> None:
    run = Run(program("a", "FATAL"))
    assert run.first(9.0)[0] == 1.0
    run.now = 1.25
    assert run.decide() == []
    run.programs["a"] = program("a")
    run.now = 1.5
    assert run.decide() == []
    run.programs["a"] = program("a", "FATAL")
    run.now = 5.0

    assert run.first(9.0)[0] == 6.0


def test_program_that_starts_in_vain_keeps_its_delay() -> None:
    run = Run(program("a", "FATAL"))
    assert run.first(9.0)[0] == 1.0
    run.programs["a"] = program("a", "BACKOFF")
    run.now = 1.25
    assert run.decide() == []
    run.programs["a"] = program("a", "FATAL")
    run.now = 5.0

    assert run.first(9.0)[0] == 7.0
