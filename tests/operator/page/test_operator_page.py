"""The wiring of the page: a page that holds the switch, with a terminal and a virtual operator."""

from __future__ import annotations

import contextlib
import json
import socket
import time
from collections.abc import Callable, Iterator
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.parameter import Parameter
from reactivex import Observable
from std_msgs.msg import Bool, Header, String
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from deploy.operator import hand, hold, operator_page, remote
from deploy.operator.hand import Hand
from deploy.operator.page.server import UPDATE_PERIOD
from deploy.operator.remote import ParameterChange, parameter_changes
from deploy.supervision import manifest
from deploy.supervision.run_directory import PAGE_FILE
from interfaces import topics
from interfaces.loopback import LOOPBACK_DOWN
from interfaces.service import ServiceNode
from interfaces.topics import CONFIGURATION
from reactive_node import ReactiveNode, stamps
from reactive_node.testing import MakeNode, SpinUntil
from services import config_publisher, dead_mans_switch, engine_controller
from tests.ports import free_port

STEP = 1.1 * UPDATE_PERIOD  # s: each step brings an update
PATIENCE = 1.0  # s: the server sends no update to a page that has not answered its ping


class Clock:
    """The clock of the hands: it stands still until all pages and the program have done what is due."""

    def __init__(self) -> None:
        self._now = 1000.0
        self._due = 0.0
        self._is_asked = self._is_done = False

    def __call__(self) -> float:
        return self._now

    def goes_on(self, pages: list[Page], program: ServiceNode) -> bool:
        """Go on if it is time to, by the clock of the machine as well; return whether it does."""
        if not self._is_asked and all(page.is_updated for page in pages):
            self._is_asked = True
            program.scheduler.schedule(self._done)
        late = time.monotonic() - self._due
        goes_on = late >= 0.0 if self._is_done else late > PATIENCE
        if goes_on:
            self.step(pages)
        return goes_on

    def step(self, pages: list[Page]) -> None:
        self._is_asked = self._is_done = False
        self._due = time.monotonic() + STEP
        for page in pages:
            page.is_updated = False
        self._now += STEP

    def _done(self, *_: Any) -> None:
        self._is_done = True


class Page:
    """A page in a test: it beats while it is held, and knows what it received last."""

    def __init__(self, connection: ClientConnection) -> None:
        self.welcome: dict[str, Any] = {}
        self.shown: dict[str, Any] = {}
        self.refused: list[dict[str, str]] = []
        self.is_held = False
        self.is_updated = True
        self.nonce = ""
        self._connection = connection

    def say(self, kind: str, **fields: Any) -> None:
        self._connection.send(json.dumps({"type": kind, **fields}))

    def press(self) -> None:
        self.say("press", nonce=self.nonce)
        self.is_held = True

    def release(self) -> None:
        self.is_held = False
        self.say("release")

    def live(self) -> None:
        with contextlib.suppress(TimeoutError):
            while True:
                message = json.loads(self._connection.recv(timeout=0.0))
                if message["type"] == "refused":
                    self.refused.append(message)
                elif message["type"] == "welcome":
                    self.welcome = message
                elif message["type"] == "update":
                    self.nonce = message["nonce"]
                    self.is_updated = True
                    self.shown |= message
                    if self.is_held:
                        self.say("beat", nonce=self.nonce)


class World:
    """The page program with a dead man's switch, two sources, and an observer of the topics."""

    def __init__(self, make_node: MakeNode, spin_until: SpinUntil, folder: Path, **options: Any) -> None:
        assert isinstance(hold.monotonic, Clock)
        self._clock = hold.monotonic
        self._make_node = make_node
        overrides = {"port": free_port(), "settings": str(folder)} | options
        self.program = self.service("operator_page", operator_page.wire, **overrides)
        self.switch = self.service("dead_mans_switch", dead_mans_switch.wire, rate=20.0)
        self.l1 = self.service("config_l1", lambda node: config_publisher.wire(node, CONFIGURATION["l1"]))
        self.folder = folder
        self.heartbeats: list[float] = []
        self.commands: list[str] = []
        observer = make_node("observer")
        observer.create_subscription(
            Bool,
            "operator_heartbeat",
            lambda _: self.heartbeats.append(time.monotonic()),
            topics.OPERATOR_HEARTBEAT.qos,
        )
        observer.create_subscription(
            String, "engines", lambda it: self.commands.append(it.data), topics.ENGINES.qos
        )
        self._pages: list[Page] = []
        self.hand: Hand | None = None  # at a terminal that lives
        self._spin_until = spin_until

    def service(self, name: str, wire: Callable[[Any], None], **values: Any) -> ServiceNode:
        overrides = [Parameter(key, value=value) for key, value in values.items()]
        node: ServiceNode = self._make_node(name, kind=ServiceNode, parameter_overrides=overrides)
        wire(node)
        return node

    def until(self, condition: Callable[[], object]) -> None:
        def lives() -> bool:
            if self._clock.goes_on(self._pages, self.program) and self.hand:
                self.hand.beat()  # not on each turn: the program would do nothing but hear it
            for page in self._pages:
                page.live()
            return bool(condition())

        self._spin_until(lives)

    def for_seconds(self, seconds: float) -> None:
        end = self._clock() + seconds
        self.until(lambda: self._clock() >= end)

    def assert_silence(self, seconds: float = 0.5) -> None:
        count = len(self.heartbeats)
        self.for_seconds(seconds)
        assert len(self.heartbeats) == count

    def delay(self, seconds: float) -> None:
        end = self._clock() + seconds
        while self._clock() < end:
            self._clock.step(self._pages)

    @contextlib.contextmanager
    def page(self, **first: Any) -> Iterator[Page]:
        """:param first: a message that the page sends before the program takes another turn."""
        line = (self.folder / PAGE_FILE).read_text().strip().removeprefix("The page: http://")
        host, _, token = line.partition("/#")
        with connect(f"ws://{host}/socket", origin=f"http://{host}", compression=None) as connection:
            connection.send(json.dumps({"type": "hello", "token": token}))
            page = Page(connection)
            if first:
                connection.send(json.dumps(first))
            self._pages.append(page)
            self.until(lambda: "processes" in page.shown)
            try:
                yield page
            finally:
                self._pages.remove(page)

    def set_pressed(self, pressed: bool) -> None:
        self.switch.set_parameters([Parameter("pressed", value=pressed)])


@pytest.fixture(autouse=True)
def _clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hold, "monotonic", Clock())


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> list[ParameterChange]:
    """What a terminal has heard of the switch: it lets go if it hears of another hand after a press."""
    heard: list[ParameterChange] = []

    def changes(events: Observable[Any], namespace: str) -> Observable[ParameterChange]:
        return parameter_changes(events, namespace).do_action(heard.append)

    monkeypatch.setattr(hand, "parameter_changes", changes)
    return heard


MakeWorld = Callable[..., World]


@pytest.fixture
def make_world(make_node: MakeNode, spin_until: SpinUntil, tmp_path: Path) -> MakeWorld:
    """Make a world; its page has the given parameters."""
    return partial(World, make_node, spin_until, tmp_path)


@pytest.fixture
def world(make_world: MakeWorld) -> World:
    return make_world()


def test_held_page_is_a_hand_on_the_switch(world: World) -> None:
    with world.page() as page:
        page.press()
        world.until(lambda: len(world.heartbeats) > 20)
        world.until(lambda: page.shown["switch"] == {"held": True, "by": "this_page"})
        assert world.switch.get_parameter("pressed").value is False

        page.release()
        world.until(lambda: page.shown["switch"] == {"held": False, "by": None})
        world.assert_silence()


def test_closed_page_is_no_hand(world: World) -> None:
    with world.page() as page:
        page.press()
        world.until(lambda: len(world.heartbeats) > 5)
    world.for_seconds(0.1)
    world.assert_silence()


def test_beats_that_were_queued_are_no_sign_of_life(world: World) -> None:
    with world.page() as page:
        page.press()
        world.until(lambda: len(world.heartbeats) > 5)
        page.is_held = False
        for _ in range(40):
            page.say("beat", nonce=page.nonce)
            world.delay(0.05)
        count = len(world.heartbeats)
        world.for_seconds(0.5)
        assert len(world.heartbeats) <= count + 1, "but for a heartbeat on its way"


def test_second_page_is_refused_while_the_first_holds(world: World) -> None:
    with world.page() as one, world.page() as two:
        one.press()
        world.until(lambda: two.shown["switch"] == {"held": True, "by": "other_page"})
        two.press()
        world.until(lambda: two.refused)
        assert two.refused == [
            {"type": "refused", "request": "press", "why": "another page holds the switch"}
        ]
        two.is_held = False
        one.release()
        world.until(lambda: two.shown["switch"]["held"] is False)
        two.press()
        world.until(lambda: one.shown["switch"] == {"held": True, "by": "other_page"})


def test_press_on_a_page_takes_the_switch_from_the_parameter(world: World) -> None:
    world.set_pressed(True)
    with world.page() as page:
        world.until(lambda: page.shown["switch"] == {"held": True, "by": "dead_mans_switch"})
        page.press()
        world.until(lambda: world.switch.get_parameter("pressed").value is False)
        world.until(lambda: page.shown["switch"] == {"held": True, "by": "this_page"})
        page.release()
        world.until(lambda: page.shown["switch"] == {"held": False, "by": None})
        world.assert_silence()


@pytest.fixture
def terminal(world: World, make_node: MakeNode, heard: list[ParameterChange]) -> Hand:
    hand = Hand(make_node("terminal_7", kind=ReactiveNode))
    world.hand = hand
    world.for_seconds(0.5)  # it meets the switch
    return hand


def test_hand_at_a_terminal_takes_the_switch_from_a_page(
    world: World, terminal: Hand, heard: list[ParameterChange]
) -> None:
    with world.page() as page:
        page.press()
        world.until(lambda: page.shown["switch"] == {"held": True, "by": "this_page"})
        world.until(lambda: heard)
        terminal.press()
        world.until(lambda: page.shown["switch"] == {"held": True, "by": "terminal"})
        assert terminal.holds
        assert world.switch.get_parameter("pressed").value is False

        page.is_held = False
        terminal.release()
        world.until(lambda: page.shown["switch"] == {"held": False, "by": None})


def test_page_takes_the_switch_from_a_hand_at_a_terminal(
    world: World, terminal: Hand, heard: list[ParameterChange]
) -> None:
    terminal.press()
    world.until(lambda: heard)
    with world.page() as page:
        world.until(lambda: page.shown["switch"] == {"held": True, "by": "terminal"})
        page.press()
        world.until(lambda: page.shown["switch"] == {"held": True, "by": "this_page"})
        world.until(lambda: not terminal.holds)
        page.release()
        world.until(lambda: page.shown["switch"] == {"held": False, "by": None})
        world.assert_silence()


def test_switch_that_is_not_there_is_taken_when_it_comes_back(world: World) -> None:
    world.set_pressed(True)
    with world.page() as page:
        world.until(lambda: page.shown["switch"]["by"] == "dead_mans_switch")
        world.switch.destroy_node()
        page.press()
        world.until(lambda: page.shown["switch"]["by"] == "this_page")
        world.for_seconds(remote.TIMEOUT + 0.5)
        world.switch = world.service("dead_mans_switch", dead_mans_switch.wire, pressed=True)
        world.until(lambda: world.switch.get_parameter("pressed").value is False)


def test_engines_are_commanded(world: World) -> None:
    with world.page() as page:
        page.say("engines", command="turn_on")
        page.say("engines", command="turn_off")
        world.until(lambda: world.commands == ["turn_on", "turn_off"])


def test_line_tells_that_a_page_has_turned_the_engines_off(world: World) -> None:
    with world.page(type="engines", command="turn_off") as page:
        world.until(lambda: page.shown.get("lines"))
    (line,) = page.shown["lines"]
    assert line["text"] == "Turning off engines, as operator_page asked..."


def test_page_shows_the_limits_of_this_arm(make_world: MakeWorld) -> None:
    limits = {"silence": 2.0, "strikes": 5, "presence_timeout": 4.0}
    with make_world(**limits).page() as page:
        assert {name: page.welcome[name] for name in limits} == limits
        assert page.welcome["off_within"] == 4.5


def test_page_sees_the_operator_as_the_controller_of_this_arm_does(
    make_node: MakeNode, make_world: MakeWorld
) -> None:
    watchdog, topic = make_node("watchdog"), topics.OPERATOR_PRESENCE
    publisher = watchdog.create_publisher(topic.type, topic.name, topic.qos)
    age = timedelta(seconds=0.5)
    watchdog.create_timer(
        0.05, lambda: publisher.publish(Header(stamp=stamps.to_message(stamps.now() - age)))
    )
    world = make_world(max_presence_age=0.2)
    with world.page() as page:
        world.until(lambda: page.shown["operator"]["age"])
        assert not page.shown["operator"]["seen"]


def test_slider_sets_its_source(world: World) -> None:
    with world.page() as page:
        assert page.shown["sources"]["l1"] == "scenario"
        for value in (2.1, 2.2, 7):
            page.say("set", name="l1", value=value)
        world.until(lambda: world.l1.get_parameter("value").value == 7.0)
        world.until(lambda: page.shown["arm"]["l1"] == 7.0)
        world.until(lambda: page.shown["sources"]["l1"] == "hand")


def test_sources_are_given_back_to_the_scenario(world: World) -> None:
    world.l1.set_parameters([Parameter("value", value=5.0)])
    with world.page() as page:
        world.until(lambda: page.shown["sources"]["l1"] == "hand")
        page.say("follow_scenario")
        world.until(lambda: page.shown["sources"]["l1"] == "scenario")
        world.until(lambda: page.shown["arm"]["l1"] == 2.0)
        world.until(lambda: page.refused)
    assert page.refused[0]["request"] == "follow_scenario", "of the sources that are not there"


def test_source_that_is_not_there_is_told(world: World) -> None:
    with world.page() as page:
        page.say("set", name="l2", value=1.0)
        world.until(lambda: page.refused)
        assert page.refused[0]["request"] == "set"
        assert "config_l2" in page.refused[0]["why"]


def test_loopback_that_goes_down_is_shown(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operator_page, "LOOPBACK_PERIOD", 0.05)
    is_up = True
    monkeypatch.setattr(operator_page, "loopback_is_up", lambda: is_up)
    with world.page() as page:

        def health() -> str:
            rows = {row["name"]: row["health"] for row in page.shown.get("processes", [])}
            return str(rows.get("sentinel"))

        world.until(lambda: health() == "no health yet")
        is_up = False
        world.until(lambda: health() == f"loopback: {LOOPBACK_DOWN}")
        is_up = True
        world.until(lambda: health() == "no health yet")


def test_processes_are_left_alone_where_none_are_supervised(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("REACTIVE_ARM_SYSTEM", raising=False)
    with world.page() as page:
        page.say("process", name="kinematics", action="kill")
        world.until(lambda: page.refused)
        assert page.refused[0]["request"] == "process"


def test_input_outside_the_protocol_is_counted_in_the_health(world: World, make_node: MakeNode) -> None:
    reports: list[Any] = []
    make_node("listener").create_subscription(
        topics.DIAGNOSTICS.type, topics.DIAGNOSTICS.name, reports.append, topics.DIAGNOSTICS.qos
    )
    with contextlib.suppress(ConnectionClosed), world.page() as page:
        page.say("nonsense")
        world.until(
            lambda: False if not reports else any("a message has no known type" in str(it) for it in reports)
        )


def test_page_reads_and_publishes_what_the_contract_says(world: World) -> None:
    contract = {topic.full_name("/"): topic for topic in topics.CONTRACT}
    for_a_while = {topics.DRIVEN_TIME.full_name("/")}  # until it knows whether there is a drive

    def promised(role: str) -> set[str]:
        ours = {manifest.PAGE, topics.EVERY_SERVICE}
        return {name for name, topic in contract.items() if ours & set(getattr(topic, role))}

    def used(endpoints: Any) -> set[str]:
        return {each.topic_name for each in endpoints} & contract.keys()

    with world.page():
        world.until(
            lambda: used(world.program.subscriptions) | for_a_while == promised("subscribers") | for_a_while
        )
    assert used(world.program.publishers) == promised("publishers")
    servers = {client.srv_name.split("/")[-2] for client in world.program.clients}
    assert servers == {*topics.PARAMETER_CLIENTS[manifest.PAGE]}


def test_topics_are_observed_only_while_a_page_is_open(
    make_world: MakeWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(operator_page, "LINGER", 0.2)
    world = make_world()

    def observed() -> set[str]:
        return {each.topic_name for each in world.program.subscriptions}

    always = {"/operator_activity", "/engines/sender"}
    world.until(lambda: observed() == always)
    with world.page():
        world.until(lambda: observed() > always | {"/effector/position", "/diagnostics", "/parameter_events"})
    world.until(lambda: observed() == always)


def test_page_that_opens_later_is_told_why_the_engines_are_off(world: World) -> None:
    world.service("engine_controller", engine_controller.wire)
    world.for_seconds(1.0)

    with world.page() as page:
        why = "not turned on since engine_controller started"
        world.until(lambda: page.shown["engines"]["why"] == why)


def test_page_ends_and_all_others_hear_of_the_end_of_the_context(world: World, context: Context) -> None:
    ended: list[str] = []
    for name in ("first", "second"):
        context.on_shutdown(partial(ended.append, name))

    context.try_shutdown()

    assert ended == ["first", "second"]


def test_taken_port_disables_the_page_and_nothing_else(make_world: MakeWorld, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        make_world(port=port)
    line = (tmp_path / PAGE_FILE).read_text()
    assert line == f"No page: port {port} of 127.0.0.1 is taken: choose another one with WEB=<port>\n"


def test_port_0_disables_the_page(make_world: MakeWorld, tmp_path: Path) -> None:
    make_world(port=0)

    assert not (tmp_path / PAGE_FILE).exists()
