"""The page of a running system: what it reads and publishes, and a hand that outlives other programs."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise

import pytest

from deploy.supervision.manifest import PAGE
from deploy.supervision.system import System
from interfaces import topics
from tests.operator.page.clients import Hand
from tests.system.sites import STEADY, Peer, Site

pytestmark = pytest.mark.timed


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, module_domain_id: int) -> Iterator[Site]:
    with closing(Site(tmp_path_factory.mktemp("page") / "run", module_domain_id)) as site:
        code, printed = site.do("start", STEADY)
        assert code == 0, printed
        assert System(site.run).page in printed.splitlines()
        yield site


class Observer(Peer):
    def __init__(self, domain: int) -> None:
        super().__init__(domain)
        self.heartbeats: list[float] = []
        topic = topics.OPERATOR_HEARTBEAT
        self.node.create_subscription(
            topic.type, topic.name, lambda _: self.heartbeats.append(time.monotonic()), topic.qos
        )

    def watch(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        self.spin_until(lambda: time.monotonic() >= end)


@pytest.fixture
def observer(site: Site) -> Iterator[Observer]:
    with closing(Observer(site.domain)) as observer:
        yield observer


@pytest.fixture
def hand(site: Site, observer: Observer) -> Iterator[Hand]:
    with closing(Hand(System(site.run).page or "")) as hand:
        observer.spin_until(lambda: "processes" in hand.shown)
        yield hand


def hold(hand: Hand, observer: Observer) -> None:
    """Hold until that shows; from now on no other hand is on the switch."""

    def is_held() -> bool:
        if hand.shown.get("switch", {}).get("by") != "this_page":
            hand.press()
            observer.watch(0.3)
        return hand.shown["switch"] == {"held": True, "by": "this_page"}

    observer.spin_until(is_held)
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
        observer.spin_until(
            lambda ask=ask, named=named: (
                {name for name, _ in ask(PAGE, "/") if name in names} | FOR_A_WHILE == named | FOR_A_WHILE
            )
        )

    def servers() -> set[str]:
        return {name.split("/")[1] for name, _ in node.get_client_names_and_types_by_node(PAGE, "/")}

    observer.spin_until(lambda: servers() == {*topics.PARAMETER_CLIENTS[PAGE]})


def test_hand_survives_the_death_of_other_programs(hand: Hand, observer: Observer, site: Site) -> None:
    for program in ("dead_mans_switch", "dead_mans_switch", "operator_watchdog", "sentinel", "config_l1"):
        hold(hand, observer)
        pid = site.members[program]
        os.kill(pid, signal.SIGKILL)
        killed = time.monotonic()
        observer.spin_until(lambda pid=pid, program=program: site.members.get(program, pid) != pid)
        observer.watch(1.0)
        beats = [at for at in observer.heartbeats if at > killed - 0.2]
        gaps = [later - earlier for earlier, later in pairwise(beats)]
        assert max(gaps) <= 0.25, program
        observer.spin_until(lambda: hand.shown["switch"]["by"] == "this_page")  # a new switch reports it
