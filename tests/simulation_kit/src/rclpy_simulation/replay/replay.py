"""A replay: feeds recorded messages to unmodified programs in virtual time, and records what they say."""

from __future__ import annotations

import signal
from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from mcap_files import rosbag2
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock

from rclpy_ground.interface import user_data_value
from rclpy_simulation.endpoints import Reader
from rclpy_simulation.host import BOOT, SECOND
from rclpy_simulation.network import Network
from rclpy_simulation.process import Process
from rclpy_simulation.replay.bag import WINDOW, Bag, Recorded
from rclpy_simulation.replay.lives import Run, live
from rclpy_simulation.replay.player import CLOCK, Offer, Player, constant_network
from rclpy_simulation.replay.recording import OF_ALL_NODES, Recording
from rclpy_simulation.simulation import Simulation

_BEFORE = SECOND // 2  # ns before the first message, at which the player publishes older latched ones
_CLOCK_PERIOD = SECOND // 100  # of a /clock that the record does not have [ns]
GRACE = 10.0
"""From SIGINT until a program is killed [s]."""


@dataclass
class Options:
    """How to replay."""

    begin: int | None = None
    """The first log time [ns since 1970]; by default, that of the bag."""
    end: int | None = None
    by_stamp: bool = False
    """Feed messages at the time in their header, not at that of their reception."""
    lead: float = 2.0
    """How long the programs run before the first message [s]: they discover each other."""
    epoch: int | None = None
    """The time of day of the programs at the first message [ns since 1970]; by default, its log time."""
    fed: frozenset[str] = frozenset()
    """Topics that are fed even if the programs publish them."""
    muted: frozenset[str] = frozenset()
    """Topics that are not fed."""
    with_rosout: bool = False
    """Whether what each node publishes is recorded: its log messages and events of its parameters."""
    environment: Mapping[str, str] = field(default_factory=dict)
    network: Network = field(default_factory=constant_network)
    seed: int = 0
    show: Callable[[str, str], Any] | None = None
    """Is called with the name of a program and what it prints."""


class Ending(NamedTuple):
    """What a program has come to."""

    name: str
    time: int
    """The log time [ns since 1970]."""
    code: int | None
    """``None`` if it was still alive long after SIGINT."""
    output: str
    is_early: bool
    """Whether it ended before SIGINT."""

    @property
    def is_failure(self) -> bool:
        return self.code is None or (self.is_early and self.code != 0)


@dataclass
class Outcome:
    begin: int
    """The first log time [ns since 1970]."""
    end: int
    topics: dict[str, int] = field(default_factory=dict)
    """How many messages of the programs were recorded, by topic."""
    published: set[str] = field(default_factory=set)
    """Recorded topics that the programs publish."""
    remarks: list[str] = field(default_factory=list)
    """What the user should know, each in one line."""
    endings: list[Ending] = field(default_factory=list)

    @property
    def has_failed(self) -> bool:
        return any(ending.is_failure for ending in self.endings)


def replay(bag: Bag, runs: Sequence[Run], output: Path, options: Options | None = None) -> Outcome:
    """Feed a bag to programs and record what they publish.

    :raises UnreadableError: if the bag is damaged.
    :raises OSError: if the output cannot be written.
    :raises ImportError: if there is no such program.
    :raises KeyboardInterrupt: at Ctrl-C, between two events: no program sees it.
    """
    return _Replay(bag, output, options or Options()).run(runs)


class _Replay:
    def __init__(self, bag: Bag, output: Path, options: Options) -> None:
        self._bag = bag
        self._options = options
        self._begin = bag.begin if options.begin is None else options.begin
        self._end = bag.end if options.end is None else options.end
        self._lead = round(options.lead * SECOND)
        self._outcome = Outcome(self._begin, self._end, remarks=list(bag.remarks))
        self._programs: dict[Process, None] = {}
        self._left_out = () if options.with_rosout else OF_ALL_NODES
        self._recording = Recording(output, self._programs, self._log_time, self._begin, self._left_out)
        self._is_ending = False
        self._killed: list[Process] = []

    def _log_time(self, monotonic: int) -> int:
        return monotonic - BOOT - self._lead + self._begin

    def _monotonic(self, log_time: int) -> int:
        return log_time - self._begin + BOOT + self._lead

    def run(self, runs: Sequence[Run]) -> Outcome:
        options = self._options
        self._runs = len(runs)
        epoch = max((self._begin if options.epoch is None else options.epoch) - self._lead, 0)

        def interrupt(*_: object) -> None:
            simulation.after(0.0, partial(signal.default_int_handler, signal.SIGINT, None))

        try:
            with Simulation(options.seed, options.network, epoch=epoch) as simulation, ExitStack() as stack:
                stack.callback(signal.signal, signal.SIGINT, signal.signal(signal.SIGINT, interrupt))
                simulation.tap(self._recording.note)
                for run in runs:
                    self._start(simulation, run)
                self._feed(simulation)
            self._recording.complete()
        finally:
            self._recording.discard()
        self._outcome.topics = self._recording.topics
        return self._outcome

    def _start(self, simulation: Simulation, run: Run) -> None:
        if CLOCK in self._bag.topics and CLOCK not in self._options.muted:
            # The user's own words come later, and win.
            run = run._replace(arguments=["--ros-args", "-p", "use_sim_time:=true", "--", *run.arguments])

        def started(process: Process) -> None:
            self._programs[process] = None
            process.at_end(lambda: self._note_end(process, run))
            if self._options.show is not None:
                process.output.listener = partial(self._options.show, process.name)

        live(simulation, run, self._options.environment, self._log_time(BOOT), started)

    def _note_end(self, process: Process, run: Run) -> None:
        now = self._log_time(process.kernel.now)
        if run.end is not None and now >= run.end:
            return  # as it should
        code = None if process in self._killed else process.exit_code
        ending = Ending(process.name, now, code, process.output.text, not self._is_ending)
        self._outcome.endings.append(ending)

    def _feed(self, simulation: Simulation) -> None:
        options = self._options
        simulation.run(options.lead / 2)
        player = self._player = Player(simulation, self._offers(), self._messages, options.fed)
        simulation.run(options.lead / 2 + (self._end - self._begin) / SECOND)
        simulation.run(0.5)  # the last answers
        if player.error is not None:
            raise player.error
        self._name_unserved(player)
        self._outcome.published = set(player.yielded) - set(self._left_out)
        for topic, time in player.yielded.items():
            if time > self._begin:
                self._remark(
                    f"{topic} was fed until {self._seconds(time)}, when a program began to publish it"
                )
        self._is_ending = True
        for process in self._alive():
            process.send_signal(signal.SIGINT)
        try:
            simulation.run_until(lambda: not self._alive(), GRACE)
        except TimeoutError:
            self._killed = self._alive()
            for process in self._killed:
                process.kill()
        simulation.run(0.0)

    def _alive(self) -> list[Process]:
        return [process for process in self._programs if not process.ended]

    # What is fed

    def _offers(self) -> dict[str, Offer]:
        offers, unknown = {}, []
        for topic in self._bag.topics.values():
            if topic.name in self._options.muted:
                continue
            try:
                offers[topic.name] = Offer(self._bag.message_type(topic), rosbag2.replayed_qos(topic)[0])
            except ValueError as error:
                unknown.append(f"{topic.name} is not fed: {error}")
        self._outcome.remarks += unknown
        if CLOCK not in self._bag.topics:
            offers[CLOCK] = Offer(Clock, QoSProfile(depth=10))
        return offers

    def _messages(self) -> Iterator[tuple[int, str, bytes]]:
        latched = {topic.name for topic in self._bag.topics.values() if _is_latched(topic)}
        past = self._past(latched)
        at = self._monotonic(self._begin) - _BEFORE
        for message in past:
            yield at, message.topic, message.data
        fed = {(message.topic, message.sent) for message in past}
        messages = self._bag.messages(None, self._begin, self._end, by_stamp=self._options.by_stamp)
        tick: Any = self._begin if CLOCK not in self._bag.topics else inf
        for message in messages:
            while tick <= message.time:
                if CLOCK in self._player.publishers:  # a program subscribes it
                    clock = Clock(clock=Time(sec=tick // SECOND, nanosec=tick % SECOND))
                    yield self._monotonic(tick), CLOCK, serialize_message(clock)
                tick += _CLOCK_PERIOD
            if not fed or (message.topic, message.sent) not in fed:
                yield self._monotonic(max(message.time, self._begin)), message.topic, message.data
            if len(self._programs) == self._runs and not self._alive():
                return

    def _past(self, latched: set[str]) -> list[Recorded]:
        """Return the latched messages that were sent before the beginning."""
        found: dict[str, deque[Recorded]] = defaultdict(lambda: deque(maxlen=100))
        if latched:
            for message in self._bag.messages(latched, None, self._begin + WINDOW):
                if message.sent < self._begin:
                    found[message.topic].append(message)
        return sorted(message for each in found.values() for message in each)

    # What is said about it

    def _remark(self, line: str) -> None:
        if line not in self._outcome.remarks:
            self._outcome.remarks.append(line)

    def _seconds(self, time: int) -> str:
        return f"{(time - self._begin) / SECOND:.3f} s"

    def _name_unserved(self, player: Player) -> None:
        """Name each client whose service nobody serves: its program may wait for ever."""
        served, asked = set(), []
        for each in player.endpoints():
            if isinstance(each, Reader) and each.topic.startswith("rq/"):
                served.add(each.topic[2:].removesuffix("Request"))
            elif isinstance(each, Reader) and each.topic.startswith("rr/"):
                asked.append((each.topic[2:].removesuffix("Reply"), each.user_data))
        for service, user_data in asked:
            if service not in served:
                namespace, name, *_ = user_data_value(user_data, "node").split(" ")
                service, _, of_action = service.partition("/_action/")
                kind = "action" if of_action else "service"
                self._remark(
                    f"{namespace.rstrip('/')}/{name} waits for the {kind} {service}, which nobody serves"
                )


def _is_latched(topic: rosbag2.Topic) -> bool:
    return bool(topic.offered) and all(
        each.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in topic.offered
    )
