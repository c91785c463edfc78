"""Which processes give no sign of one kind by their own fault: pure, in virtual time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from deploy.supervision import manifest
from deploy.supervision.supervisord import Program
from interfaces.service.health import PERIOD


class Silent(NamedTuple):
    program: Program
    seconds: float
    """without a sign [s]"""


class _Heard(NamedTuple):
    """The known facts about a process."""

    last: float | None
    """time of its last sign [s]; None before the first"""
    silence: float
    """time since then in which it could give one [s]"""
    timeout: float
    """how long it may be silent [s]"""
    spared: float
    """time since its silence was last excused [s]"""


class Silence:
    """Judges the silence of processes, one observation after the other."""

    def __init__(self, timeout: float, start: float) -> None:
        """
        :param timeout: how long a process may be silent after a sign [s].
        :param start: how long a new process may be, and one whose silence was excused [s].
        """
        self.inhibited_by = ""
        """why silent processes are not judged; '' if they are"""
        self.hears_itself = True
        """whether the signs of the sentinel itself arrive"""
        self.delayed: list[Program] = []
        """processes that would be silent for too long if the machine had let them run"""
        self._timeout = timeout
        self._start = start
        self._heard: dict[int, _Heard] = {}  # by pid
        self._deaf = -math.inf  # for how long the sentinel has not heard itself [s]

    def judge(
        self,
        running: Sequence[Program],
        signs: Mapping[int, float],
        now: float,
        passed: Mapping[int, float],
        excuse: str = "",
    ) -> list[Silent]:
        """Return the processes that are silent by their own fault.

        :param signs: time of the last sign of each process, by pid [s].
        :param now: time of the observation, by the same clock [s].
        :param passed: time since the last observation in which each process could give a sign, by pid [s].
        :param excuse: why signs may be lost; '' if all arrive.
        """
        self._heard = {
            each.pid: self._hear(each, signs.get(each.pid), now, passed[each.pid]) for each in running
        }
        silent = [each for each in running if self._is_silent(each.pid)]
        self.delayed = [each for each in running if self._is_delayed(each.pid, now)]
        itself = [each for each in silent if each.name == manifest.sentinel()]
        self.hears_itself = not itself or bool(excuse)
        if not self.hears_itself:
            self.inhibited_by = "the sentinel does not hear itself"
            self._deaf = max(0.0, self._deaf + passed[itself[0].pid])
            # A deaf sentinel is useless; its successor may hear.
            return [self._judged(each) for each in itself if self._deaf >= self._start]
        self._deaf = -math.inf
        self.inhibited_by = (excuse or self._most()) if silent else ""
        if self.inhibited_by:
            for each in silent:
                self._heard[each.pid] = self._heard[each.pid]._replace(spared=0.0)
        return [self._judged(each) for each in silent if self._heard[each.pid].spared >= self._start]

    def _judged(self, program: Program) -> Silent:
        return Silent(program, self._heard[program.pid].silence)

    def _hear(self, program: Program, last: float | None, now: float, passed: float) -> _Heard:
        known = self._heard.get(program.pid)
        if known is None:
            # A new sentinel subtracts the time that the process has had already.
            first = max(2 * self._timeout, self._start - program.uptime)
            if last is None:
                return _Heard(None, 0.0, first, math.inf)
            return _Heard(last, now - last, self._timeout, math.inf)
        if last is None or last == known.last:
            return known._replace(silence=known.silence + passed, spared=known.spared + passed)
        return _Heard(last, min(now - last, passed), self._timeout, math.inf)

    def _is_silent(self, pid: int) -> bool:
        return self._heard[pid].silence >= self._heard[pid].timeout

    def _is_delayed(self, pid: int, now: float) -> bool:
        last = self._heard[pid].last
        return last is not None and now - last >= self._timeout and not self._is_silent(pid)

    def _most(self) -> str:
        """Return that most processes are silent at once, or will be within the period of their signs."""
        known = self._heard.items()
        expected = [each for pid, each in known if each.last is not None or self._is_silent(pid)]
        late = sum(each.silence >= each.timeout - PERIOD for each in expected)
        if late > 1 and 2 * late > len(expected):
            return f"{late} of {len(expected)} services are silent at once"
        return ""
