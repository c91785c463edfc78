"""A node outside of the arm that records, with their source times, the messages that the switch moves."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from interfaces import topics
from tests.system.sites import LIMIT, Peer

DEPTH = 500  # messages that may wait while this process is not scheduled


class State(NamedTuple):
    time: float
    engines: str


class Record:
    """The heartbeats and the engines' states since the beginning; a thread takes them."""

    def __init__(self, domain: int) -> None:
        self.beats: list[float] = []
        """Source times [s since 1970]."""
        self.states: list[State] = []
        self._peer = Peer(domain)
        self._commands = self._peer.publisher(topics.ENGINES)
        self._read(topics.OPERATOR_HEARTBEAT, lambda at, _: self.beats.append(at))
        self._read(topics.ENGINES_STATE, lambda at, message: self.states.append(State(at, message.data)))
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _read(self, topic: topics.Topic, receive: Callable[[float, Any], None]) -> None:
        def read(message: Any, info: Any) -> None:
            receive(info["source_timestamp"] / 1e9, message)

        deep = QoSProfile(depth=DEPTH, reliability=topic.qos.reliability, lifespan=Duration())
        self._peer.node.create_subscription(topic.type, topic.name, read, deep)

    def _spin(self) -> None:
        while not self._end.is_set():
            self._peer.spin_once(0.1)

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
        """Wait until the engines are off after a moment; when the drive stopped them [s since 1970].

        It stops at ``off``, and when no ``on`` has come for ``topics.DRIVE_TIMEOUT``.
        """

        def offs() -> list[float]:
            return [it.time for it in self.states if it.time > moment and it.engines == topics.OFF]

        self.until(offs)
        stopped = offs()[0]
        last_on = max(it.time for it in self.states if it.time < stopped and it.engines == topics.ON)
        return min(stopped, last_on + topics.DRIVE_TIMEOUT)

    def close(self) -> None:
        self._end.set()
        self._thread.join()
        self._peer.close()
