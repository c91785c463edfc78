"""The page of a running system: hands that come and go, and what breaks under them."""

from __future__ import annotations

import itertools
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from deploy.supervision.manifest import PAGE
from deploy.supervision.system import System
from interfaces import topics
from interfaces.topics import OFF, ON
from tests.operator.page.clients import Hand, Link
from tests.system.sites import LIMIT, Peer, Site

pytestmark = pytest.mark.timed

STEADY = str(Path(__file__).parents[2] / "system" / "steady.yaml")
S1 = 10.5  # s
RELEASED = 0.15  # s from a release to the last heartbeat, on this machine
LATCHED = 0.3  # s: the age of a nonce, and a heartbeat on its way


@pytest.fixture(scope="module")
def module_site(tmp_path_factory: pytest.TempPathFactory, module_domain_id: int) -> Iterator[Site]:
    with closing(Site(tmp_path_factory.mktemp("page") / "run", module_domain_id)) as site:
        yield site


@pytest.fixture(scope="module", autouse=True)
def address(module_site: Site) -> str:
    code, printed = module_site.do("start", STEADY)
    assert code == 0, printed
    (line,) = (line for line in printed.splitlines() if line.startswith("The page: "))
    assert line == System(module_site.run).page
    return line


class Observer:
    def __init__(self, domain: int) -> None:
        self.heartbeats: list[float] = []
        self.engines = ""
        self._peer = Peer(domain)
        self.node = self._peer.node
        self._subscribe(topics.OPERATOR_HEARTBEAT, lambda _: self.heartbeats.append(time.monotonic()))
        self._subscribe(topics.ENGINES_STATE, self._on_state)

    def _subscribe(self, topic: topics.Topic, callback: Callable[[Any], None]) -> None:
        self._peer.node.create_subscription(topic.type, topic.name, callback, topic.qos)

    def _on_state(self, message: Any) -> None:
        self.engines = message.data

    def until(self, condition: Callable[[], object], seconds: float = LIMIT) -> float:
        self._peer.spin_until(condition, seconds)
        return time.monotonic()

    def watch(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        self._peer.spin_until(lambda: time.monotonic() >= end)

    def after(self, time: float) -> list[float]:
        return [at - time for at in self.heartbeats if at > time]

    def close(self) -> None:
        self._peer.close()


@pytest.fixture
def observer(module_site: Site) -> Iterator[Observer]:
    with closing(Observer(module_site.domain)) as observer:
        yield observer


@pytest.fixture
def hand(address: str, observer: Observer) -> Iterator[Hand]:
    with closing(Hand(address)) as hand:
        observer.until(lambda: "processes" in hand.shown)
        yield hand


def hold(hand: Hand, observer: Observer) -> None:
    """Hold until that shows; from now on no other hand is on the switch."""

    def is_held() -> bool:
        if hand.shown.get("switch", {}).get("by") != "this_page":
            hand.press()
            observer.watch(0.3)
        return hand.shown["switch"] == {"held": True, "by": "this_page"}

    observer.until(is_held)
    observer.watch(0.5)  # until the virtual switch is released as well


FOR_A_WHILE = {topics.DRIVEN_TIME.full_name("/")}
"""What the page reads only until it knows whether there is a drive."""


def test_page_reads_and_publishes_what_the_contract_says(hand: Hand, observer: Observer) -> None:
    hold(hand, observer)
    node, names = observer.node, {topic.full_name("/"): topic for topic in topics.CONTRACT}
    endpoints = {
        "subscribers": node.get_subscriber_names_and_types_by_node,
        "publishers": node.get_publisher_names_and_types_by_node,
    }
    for role, ask in endpoints.items():
        named = {
            name for name, topic in names.items() if {PAGE, topics.EVERY_SERVICE} & set(getattr(topic, role))
        }
        observer.until(
            lambda ask=ask, named=named: (
                {name for name, _ in ask(PAGE, "/") if name in names} | FOR_A_WHILE == named | FOR_A_WHILE
            )
        )

    def servers() -> set[str]:
        return {name.split("/")[1] for name, _ in node.get_client_names_and_types_by_node(PAGE, "/")}

    observer.until(lambda: servers() == {*topics.PARAMETER_CLIENTS[PAGE]})


def test_release_is_visible_at_once(hand: Hand, observer: Observer) -> None:
    hold(hand, observer)
    delays = []
    for _ in range(20):
        hand.press()
        observer.watch(0.2)
        released = hand.release()
        observer.watch(0.35)
        delays.append(max(observer.after(released), default=0.0))
    assert max(delays) <= RELEASED, delays


def test_engines_go_off_in_time_when_the_hand_is_gone(hand: Hand, observer: Observer) -> None:
    hold(hand, observer)
    observer.watch(1.0)
    hand.say("engines", command="turn_on")
    observer.until(lambda: observer.engines == ON)
    observer.until(lambda: hand.shown["engines"]["state"] == ON)
    released = hand.release()
    off = observer.until(lambda: observer.engines == OFF)
    assert off - released <= S1
    observer.until(lambda: "incapacitated" in hand.shown["engines"]["why"])
    assert hand.shown["operator"]["strikes_left"] == 0


STARTED = "not turned on since engine_controller started"


def test_killed_controller_is_the_reason_that_the_engines_are_off(
    hand: Hand, observer: Observer, module_site: Site
) -> None:
    hold(hand, observer)
    observer.watch(1.0)
    hand.say("engines", command="turn_on")
    observer.until(lambda: hand.shown["engines"]["state"] == ON)
    os.kill(module_site.members["engine_controller"], signal.SIGKILL)
    observer.until(lambda: hand.shown["engines"]["state"] == OFF)
    observer.until(lambda: hand.shown["engines"]["why"] == STARTED)


def test_closed_page_is_released(address: str, observer: Observer) -> None:
    hand = Hand(address)
    observer.until(lambda: "processes" in hand.shown)
    hold(hand, observer)
    closed = time.monotonic()
    hand.close()
    observer.watch(1.0)
    assert max(observer.after(closed), default=0.0) <= LATCHED


def test_killed_page_program_is_a_silent_operator(
    hand: Hand, observer: Observer, address: str, module_site: Site
) -> None:
    hold(hand, observer)
    old = module_site.members[PAGE]
    os.kill(old, signal.SIGKILL)
    killed = time.monotonic()
    observer.watch(2.0)
    assert max(observer.after(killed), default=0.0) <= LATCHED
    module_site.await_members(lambda members: members.get(PAGE, old) != old)

    def finds_it_again() -> bool:
        try:
            return bool(Hand(address))
        except OSError:
            return False

    observer.until(finds_it_again)


# Shorter than the patience of the sentinel: it restarts a process that was silent for longer.
@pytest.mark.parametrize("seconds", [0.6, 1.2])
def test_paused_page_program_holds_nothing_when_it_goes_on(
    hand: Hand, observer: Observer, module_site: Site, seconds: float
) -> None:
    hold(hand, observer)
    pid = module_site.members[PAGE]
    os.kill(pid, signal.SIGSTOP)
    stopped = time.monotonic()
    observer.watch(seconds)
    os.kill(pid, signal.SIGCONT)
    observer.watch(1.5)  # in which the hand goes on to beat
    assert max(observer.after(stopped), default=0.0) <= LATCHED
    assert hand.shown["switch"]["by"] is None
    hold(hand, observer)


def test_beats_behind_a_stalled_link_count_for_nothing(observer: Observer, address: str) -> None:
    link = Link(int(address.partition("127.0.0.1:")[2].partition("/")[0]))
    with closing(Hand(address, link=link)) as hand:
        observer.until(lambda: "processes" in hand.shown)
        hold(hand, observer)
        link.stall()
        stalled = time.monotonic()
        observer.watch(2.0)
        link.heal()
        observer.watch(1.5)
        assert max(observer.after(stalled), default=0.0) <= LATCHED
        assert hand.shown["switch"]["by"] is None
        hold(hand, observer)


def test_hand_survives_the_death_of_other_programs(hand: Hand, observer: Observer, module_site: Site) -> None:
    for program in ("dead_mans_switch", "dead_mans_switch", "operator_watchdog", "sentinel", "config_l1"):
        hold(hand, observer)
        pid = module_site.members[program]
        os.kill(pid, signal.SIGKILL)
        killed = time.monotonic()
        observer.until(lambda pid=pid, program=program: module_site.members.get(program, pid) != pid)
        observer.watch(1.0)
        gaps = [later - earlier for earlier, later in itertools.pairwise(observer.after(killed - 0.2))]
        assert max(gaps) <= 0.25, program
        observer.until(lambda: hand.shown["switch"]["by"] == "this_page")  # a new switch reports it again


def test_page_kills_and_stops_processes(hand: Hand, observer: Observer, module_site: Site) -> None:
    for action, program in (("kill", "kinematics"), ("stop", "velocity")):
        pid = module_site.members[program]
        observer.until(
            lambda program=program, pid=pid: (
                {"name": program, "pid": pid}.items()
                <= next(row for row in hand.shown["processes"] if row["name"] == program).items()
            )
        )
        hand.say("process", name=program, action=action)
        observer.until(lambda program=program, pid=pid: module_site.members.get(program, pid) != pid)
    assert hand.refused == []
