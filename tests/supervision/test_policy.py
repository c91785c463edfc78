from __future__ import annotations

from collections.abc import Iterable
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deploy.supervision.manifest import SENTINEL
from deploy.supervision.policy import RECENT, Action, Observation, Policy, Timeouts
from deploy.supervision.processes import Effort, Process
from deploy.supervision.reaction import RESTART
from deploy.supervision.sentinel import Parameters
from deploy.supervision.supervisord import Program
from interfaces.service.health import PERIOD
from interfaces.service.parameters import declarations

TIMEOUTS = Timeouts(period=0.25, health=2.5)  # times without rounding
PIDS = {name: 100 + index for index, name in enumerate(("a", "b", "c", "d", "e", SENTINEL))}


def program(name: str, state: str = "RUNNING", uptime: float = 0.0, restarts: int = 0) -> Program:
    return Program(name, state, PIDS[name], uptime, restarts, "", "")


class Run:
    def __init__(self, *programs: Program) -> None:
        self.policy = Policy(TIMEOUTS)
        self.programs = {each.name: each for each in programs}
        self.now = 0.0
        self.last_beat: dict[int, float] = {}
        self.last_health: dict[tuple[str, int], float] = {}
        self.efforts: dict[int, Effort] = {}
        self.flood = ""

    def hear(self, names: Iterable[str], mute: Iterable[str] = ()) -> None:
        for name in names:
            self.last_beat[PIDS[name]] = self.now
            if name not in mute:
                self.last_health[name, PIDS[name]] = self.now

    def decide(self, *, stopped: Iterable[str] = (), duplicates: Iterable[Process] = ()) -> list[Action]:
        return self.policy.decide(
            Observation(
                self.now,
                [*self.programs.values()],
                dict(self.last_beat),
                dict(self.last_health),
                dict(self.efforts),
                self.flood,
                frozenset(PIDS[name] for name in stopped),
                frozenset(duplicates),
            )
        )

    def first(
        self, until: float, healthy: Iterable[str] = (), mute: Iterable[str] = (), **seen: Iterable[str]
    ) -> tuple[float, list[Action]]:
        """Observe until there are actions; return when, and the actions."""
        while self.now <= until:
            self.hear(healthy, mute)
            if actions := self.decide(**seen):  # type: ignore[arg-type]
                return self.now, actions
            self.now += TIMEOUTS.period
        return self.now, []


def silence_of(seconds: float, name: str) -> Action:
    return Action("kill", name, PIDS[name], f"no sign of life for {seconds:.1f} s")


def test_nothing_is_inhibited_before_and_after_a_good_observation() -> None:
    policy, observation = Policy(), Observation(0.0, [program("a")])
    assert policy.kill_inhibited_by == observation.flood == ""
    assert policy.hears_itself is True
    assert policy.decide(observation) == []
    assert policy.kill_inhibited_by == ""
    assert policy.recent_restarts == {"a": 0}
    assert policy.reasons == {}


def test_silent_program_is_killed_at_the_timeout_and_the_reason_kept() -> None:
    run = Run(program("a"), program("b"))
    run.now = 5.0
    run.hear("ab")

    assert run.first(9.0, healthy="b") == (7.5, [silence_of(2.5, "a")])
    assert run.policy.reasons == {"a": "no sign of life for 2.5 s"}


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


def test_pause_of_the_sentinel_counts_for_no_stop() -> None:
    run = Run(*map(program, "ab"))
    assert run.first(0.25, healthy="b", stopped="a") == (0.5, [])
    run.now += 30.0
    at, actions = run.first(60.0, healthy="b", stopped="a")
    assert at == 30.5 + 2.5 - 0.5
    assert [each.program for each in actions] == ["a"]


def test_stopped_program_is_killed_although_most_are_silent() -> None:
    run = Run(*map(program, "abc"))
    run.hear("abc")
    assert run.first(3.0)[1] == []

    assert run.first(9.0, stopped="a") == (5.75, [Action("kill", "a", PIDS["a"], "stopped for 2.5 s")])
    assert run.policy.kill_inhibited_by == "2 of 2 services are silent at once"


def test_program_that_continues_in_time_is_spared() -> None:
    run = Run(*map(program, "ab"))
    for _ in range(3):
        assert run.first(run.now + 2.0, healthy="ab", stopped="a")[1] == []
        assert run.first(run.now, healthy="ab")[1] == []


def test_program_that_was_stopped_on_purpose_is_spared() -> None:
    assert Run(program("a", "STOPPED"), program("b")).first(30.0, healthy="b")[1] == []


def test_health_of_another_process_of_that_name_does_not_count() -> None:
    run = Run(program("a")._replace(pid=500), program("b"))
    while not (actions := run.decide()) and run.now < 30.0:
        run.now += TIMEOUTS.period
        run.hear("ab")
        run.last_beat[500] = run.now

    assert actions == [report_of(20.0, "a")._replace(pid=500)]


def test_observation_is_complete_when_each_present_process_has_reported() -> None:
    programs = [program("a"), program("b")]
    reports = {("a", PIDS["a"]): 1.0, ("b", 999): 1.0}
    assert not Observation(2.0, programs, last_health=reports).is_complete
    reports["b", PIDS["b"]] = 2.0
    assert Observation(2.0, programs, last_health=reports).is_complete
    more = [*programs, program("c", "BACKOFF")]
    assert not Observation(2.0, more, last_health=reports).is_complete


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


def test_deaf_sentinel_kills_no_other_and_ends_itself_at_the_start_timeout() -> None:
    run = Run(*map(program, (SENTINEL, "a", "b")))
    run.hear([SENTINEL, "a", "b"])

    assert run.first(12.25, healthy="a")[1] == []
    assert run.policy.kill_inhibited_by == "the sentinel does not hear itself"
    assert not run.policy.hears_itself
    assert run.first(20.0, healthy="a") == (12.5, [silence_of(12.5, SENTINEL)])


def test_sentinel_that_heard_itself_can_be_deaf_again() -> None:
    run = Run(program(SENTINEL), program("a"))
    run.hear([SENTINEL, "a"])
    assert run.first(12.0, healthy="a")[1] == []
    run.hear([SENTINEL, "a"])
    heard = run.now
    assert run.decide() == []
    assert run.policy.hears_itself
    assert run.policy.kill_inhibited_by == ""

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
    run = Run(program("a", restarts=4), program("b"))
    recent = []
    for time, restarts in ((0.0, 4), (10.0, 5), (20.0, 6), (69.5, 6), (70.0, 6), (79.5, 6), (80.0, 6)):
        while run.now < time:
            run.hear("ab")
            run.decide()
            run.now += TIMEOUTS.period
        run.programs["a"] = program("a", restarts=restarts)
        run.hear("ab")
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


# Reports and floods


def report_of(seconds: float, name: str) -> Action:
    return Action("kill", name, PIDS[name], f"no report of health for {seconds:.1f} s")


def test_service_that_is_heard_no_more_is_killed_later_than_one_that_hangs() -> None:
    run = Run(*(program(name) for name in "abc"))
    run.hear("abc")

    assert run.first(20.0, healthy="abc", mute="a") == (10.0, [report_of(10.0, "a")])


def test_lost_reports_are_no_silence() -> None:
    run = Run(*(program(name) for name in ("a", "b", "c", SENTINEL)))
    run.hear(["a", "b", "c", SENTINEL])
    run.flood = "reports of health are lost"

    assert run.first(100.0, healthy=["a", "b", "c", SENTINEL], mute=["a", SENTINEL])[1] == []
    assert run.policy.kill_inhibited_by == "reports of health are lost"
    assert run.policy.hears_itself


def test_service_that_is_not_heard_after_a_flood_has_the_start_timeout() -> None:
    run = Run(*(program(name) for name in "abc"))
    run.hear("abc")
    run.flood = "reports of health are lost"
    assert run.first(30.0, healthy="abc", mute="a")[1] == []
    run.flood = ""
    calm = run.now

    when, actions = run.first(100.0, healthy="abc", mute="a")
    assert (when, [action.program for action in actions]) == (calm - 0.25 + 10.0, ["a"])


def test_hung_service_is_killed_in_time_while_reports_are_lost() -> None:
    run = Run(*(program(name) for name in "abc"))
    run.hear("abc")
    run.flood = "reports of health are lost"

    assert run.first(9.0, healthy="bc", mute="bc") == (2.5, [silence_of(2.5, "a")])


class Kernel(Run):
    """Service `a` gives no sign; the kernel gives its loop and its other threads parts of a processor."""

    def first_kill(
        self, loop: float, waited: float, others: float, flood: str, until: float = 60.0
    ) -> float | None:
        self.flood = flood
        self.hear("abc")
        while self.now <= until:
            self.hear("bc")
            self.efforts = {PIDS["a"]: Effort(*(part * self.now for part in (loop, waited, others)))}
            if self.decide():
                return self.now
            self.now += TIMEOUTS.period
        return None


@pytest.mark.parametrize("flood", ["", "a flood"])
@pytest.mark.parametrize(
    ("loop", "waited", "others", "killed"),
    [
        (1.0, 0.0, 0.0, 2.5),  # an endless loop
        (0.5, 0.5, 0.0, 2.5),  # the same, which shares its processor with another
        (0.5, 0.5, 1.0, 2.5),
        (0.25, 0.75, 0.0, 5.0),  # with three others
        (0.0, 0.0, 0.0, 2.5),  # a deadlock
    ],
)
def test_hung_loop_is_found_on_a_busy_machine(
    loop: float, waited: float, others: float, killed: float, flood: str
) -> None:
    assert Kernel(*(program(name) for name in "abc")).first_kill(loop, waited, others, flood) == killed


def test_loop_that_waits_for_a_processor_is_not_hung() -> None:
    run = Kernel(*(program(name) for name in "abc"))
    assert run.first_kill(0.01, 0.99, 0.0, "") is None
    assert run.policy.delayed == ["a"]
    run.hear("abc")
    assert run.decide() == []
    assert run.policy.delayed == []


def test_loop_that_waits_for_threads_of_dds_is_hung_unless_there_is_a_flood() -> None:
    def run() -> Kernel:
        return Kernel(*(program(name) for name in "abc"))

    assert run().first_kill(0.0, 0.0, 1.0, "") == 2.5
    assert run().first_kill(0.0, 0.0, 1.0, "a flood") is None
    assert run().first_kill(0.0, 0.0, 0.5, "a flood") == 5.0


LIMIT = 5.0  # s: promise L4


@settings(max_examples=200, deadline=None)
@given(
    period=st.sampled_from([0.05, 0.1, 0.25, 0.3, 0.5]),
    health=st.floats(2.7, 3.3),
    phases=st.lists(st.floats(0.0, 1.0), min_size=4, max_size=4),
    jitter=st.floats(0.0, 0.3),
    seed=st.randoms(use_true_random=False),
    hangs=st.floats(12.0, 14.0),
)
def test_with_each_legal_timeout_only_the_hung_service_is_replaced_and_in_time(
    period: float, health: float, phases: list[float], jitter: float, seed: Random, hangs: float
) -> None:
    names = ("a", "b", "c", SENTINEL)
    policy = Policy(Timeouts(period, health))
    beats = {
        name: [phase + number + seed.uniform(-jitter, jitter) for number in range(40)]
        for name, phase in zip(names, phases, strict=True)
    }
    beats["a"] = [when for when in beats["a"] if when <= hangs]
    looks = [number * period for number in range(round(20.0 / period))]
    for now in looks:
        last = {
            PIDS[name]: max(past) for name, times in beats.items() if (past := [t for t in times if t <= now])
        }
        actions = policy.decide(Observation(now, [program(name) for name in names], last))
        if actions:
            assert [action.program for action in actions] == ["a"]
            assert now <= hangs + LIMIT - RESTART
            return
    pytest.fail("not replaced")


def test_default_timeouts_are_legal() -> None:
    assert [each.name for each in declarations(Parameters) if each.problem(each.default)] == []


def test_timeouts_that_break_l4_or_the_rule_of_most_are_illegal() -> None:
    within = {each.name: each.within or (0.0, 0.0) for each in declarations(Parameters)}
    assert within["health_timeout"][1] <= LIMIT - RESTART - within["period"][1]
    # What fails for most at once is known before the first of them is killed.
    assert within["health_timeout"][0] >= 2 * PERIOD + within["period"][1]
