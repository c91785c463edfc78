"""A node beside the arm that records, with their source times, the messages that the switch moves."""

from __future__ import annotations

import ctypes
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from interfaces import topics
from tests.system.sites import LIMIT, Peer

CLONE_NEWNET = 0x40000000  # linux/sched.h
DEPTH = 500  # messages that may wait while this process is not scheduled


class State(NamedTuple):
    """A message on ``engines/state``."""

    time: float
    engines: str


class Record:
    """The heartbeats and the engines' states since the beginning; a thread takes them."""

    def __init__(self, domain: int, namespace: str = "") -> None:
        """:param namespace: the network namespace of the arm; empty for that of this process."""
        self.beats: list[float] = []
        """Source times [s since 1970]."""
        self.states: list[State] = []
        self._ended = threading.Event()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(domain, namespace), daemon=True)
        self._thread.start()
        assert self._ready.wait(LIMIT)

    def _run(self, domain: int, namespace: str) -> None:
        if namespace:  # the threads and sockets of DDS begin in the namespace of this thread
            with Path("/run/netns", namespace).open() as file:
                entered = ctypes.CDLL(None, use_errno=True).setns(file.fileno(), CLONE_NEWNET)
                assert entered == 0, os.strerror(ctypes.get_errno())
        peer = Peer(domain)
        try:
            self._subscribe(peer, topics.OPERATOR_HEARTBEAT, lambda at, _: self.beats.append(at))
            self._subscribe(peer, topics.ENGINES_STATE, lambda at, it: self.states.append(State(at, it.data)))
            self._commands = peer.publisher(topics.ENGINES)
            self._ready.set()
            while not self._ended.is_set():
                peer.spin_once(0.1)
        finally:
            peer.close()

    @staticmethod
    def _subscribe(peer: Peer, topic: topics.Topic, take: Callable[[float, Any], None]) -> None:
        qos = topic.qos
        deep = QoSProfile(depth=DEPTH, reliability=qos.reliability, lifespan=Duration())

        def receive(message: Any, info: Any) -> None:
            take(info["source_timestamp"] / 1e9, message)

        peer.node.create_subscription(topic.type, topic.name, receive, deep)

    def until(self, condition: Callable[[], object], seconds: float = LIMIT, period: float = 0.005) -> None:
        """Wait until a condition is true; look once in a period [s]."""
        deadline = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < deadline, f"not within {seconds} s"
            time.sleep(period)

    def beats_after(self, moment: float) -> list[float]:
        """The heartbeats that were published after a moment [s since 1970]."""
        return [beat for beat in self.beats if beat > moment]

    def await_beats(self, moment: float, count: int = 1) -> None:
        """Wait for heartbeats that were published after a moment."""
        self.until(lambda: len(self.beats_after(moment)) >= count)

    def silence_after(self, moment: float, seconds: float = 0.5) -> None:
        """Assert that no heartbeat was published after a moment; look on for some time."""
        time.sleep(max(0.0, moment + seconds - time.time()))
        late = [beat - moment for beat in self.beats_after(moment)]
        assert not late, f"heartbeats {late} s after the release"

    def turn_on(self, is_held: Callable[[], bool]) -> None:
        """Command the engines, as the terminal does, until they are on or the switch is not held."""
        begin, due = time.time(), 0.0

        def are_on() -> bool:
            return any(state.time > begin and state.engines == topics.ON for state in self.states)

        while not are_on():
            assert time.time() < begin + LIMIT, "the engines are not on"
            if time.monotonic() > due:
                if not is_held():
                    return
                due = time.monotonic() + 0.5
                self._commands.publish(String(data=topics.TURN_ON))
            time.sleep(0.01)

    def await_off(self, moment: float) -> float:
        """
        Wait until the engines are off after a moment; when the drive stopped them [s since 1970].

        It stops at ``off``, and when no ``on`` has come for ``topics.DRIVE_TIMEOUT``.
        """

        def offs() -> list[float]:
            return [it.time for it in self.states if it.time > moment and it.engines == topics.OFF]

        self.until(offs)
        stopped = offs()[0]
        last_on = max(it.time for it in self.states if it.time < stopped and it.engines == topics.ON)
        return min(stopped, last_on + topics.DRIVE_TIMEOUT)

    def close(self) -> None:
        """Leave the domain."""
        self._ended.set()
        self._thread.join()
