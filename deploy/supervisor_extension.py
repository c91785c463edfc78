"""What supervisord lacks for a robot, plugged in through its own extension point (supervisord.conf).

- It counts how often it started each program: RPC `arm.starts`.
- It looks after its children every 100 ms and at once after each change, instead of once a second: a killed
  service is started again 1–2 s later otherwise.

Runs inside supervisord, so it must not fail: it does nothing else.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

from supervisor import events

LONGEST_WAIT = 0.1  # s


class ArmInterface:
    """The RPC namespace `arm` of one supervisord."""

    def __init__(self, supervisord: Any) -> None:
        self._starts: Counter[str] = Counter()
        self._changed = False
        self._poll = supervisord.options.poller.poll
        supervisord.options.poller.poll = self._poll_briefly
        events.subscribe(events.ProcessStateEvent, self._on_change)

    def starts(self) -> dict[str, int]:
        """How often each program was started since supervisord runs."""
        return dict(self._starts)

    def _on_change(self, event: Any) -> None:
        self._changed = True
        if isinstance(event, events.ProcessStateStartingEvent):
            self._starts[event.process.config.name] += 1

    def _poll_briefly(self, timeout: float) -> Any:
        # supervisord acts on a change only after its next poll: a change must not wait for one to time out.
        wait = 0.0 if self._changed else min(timeout, LONGEST_WAIT)
        self._changed = False
        return self._poll(wait)


def make_interface(supervisord: Any, **config: str) -> ArmInterface:
    """The factory that supervisord.conf names."""
    return ArmInterface(supervisord)
