"""The messages to one page: what it shows of a state, and what has changed since the last message."""

from __future__ import annotations

import math
from typing import Any

from deploy.operator.engines import RENEWED
from deploy.operator.page.protocol import LIMITS
from deploy.operator.page.state import BEAT, PROGRAMS, Clock, PageState, Program
from deploy.supervision import manifest, sentinel
from interfaces import topics
from interfaces.loopback import LOOPBACK_DOWN
from interfaces.topics import ON

REFUSAL_VISIBLE = 10.0  # s
HEALTH_TIMEOUT = sentinel.Parameters().health_timeout  # a sentinel that waits longer hides no silence
SILENT_CONTROLLER = "the engine controller is silent, so the drive stops the engines"


def view(state: PageState, page: str, now: float) -> dict[str, Any]:
    """Return what a page shows of a state at a time [s], by keys of an update."""
    arm = state.arm
    return {
        "arm": {name: arm.configuration.get(name) for name in topics.CONFIGURATION},
        "position": {"x": arm.position[0], "y": arm.position[1]} if arm.position else None,
        "speed": arm.fresh_speed(now),
        "unheard": arm.unheard(now),
        **moment(state, page, now),
        "sources": {name: "hand" if name in state.by_hand else "scenario" for name in LIMITS},
        "processes": [_row(name, state, now) for name in PROGRAMS],
    }


def moment(state: PageState, page: str, now: float) -> dict[str, Any]:
    """Return the part of a view that the page draws over time."""
    operator, hands, engines = state.operator, state.hands, state.engines
    holder = hands.hold.holder(now)
    age = now - operator.seen
    is_reported = now - engines.reported <= RENEWED
    cause = engines.known if is_reported else None
    refused = cause.refused or None if cause and now - engines.explained <= REFUSAL_VISIBLE else None
    by = (
        ("this_page" if holder == page else "other_page") if holder else hands.holder.name(now, manifest.PAGE)
    )
    is_held = by is not None
    return {
        "operator": {
            "seen": age <= state.max_presence_age,
            "age": round(age, 1) if math.isfinite(age) else None,
            "activity": operator.activity,
            "strikes_left": operator.strikes_left,
        },
        "switch": {
            "held": is_held,
            "by": by or None,
        },
        "engines": {
            "state": engines.state if is_reported else None,
            "why": cause.words if cause else "" if is_reported else SILENT_CONTROLLER,
            "since": engines.since if cause else None,
            "refused": refused,
            "stops_in": _stops_in(state, now, is_held) if is_reported and engines.state == ON else None,
        },
    }


def _stops_in(state: PageState, now: float, is_held: bool) -> float | None:
    """Return how long the engines stay on if nobody holds from now on, and nothing dies [s].

    ``None`` if that is not known.
    """
    operator = state.operator
    ends = []
    if operator.strikes_left is not None and math.isfinite(operator.concluded):
        ends.append((now if is_held else operator.concluded) + operator.strikes_left * state.silence)
    if is_held or math.isfinite(operator.seen):
        ends.append((now if is_held else operator.seen) + state.presence_timeout)
    return round(max(0.0, min(ends) - now), 1) if ends else None


def lasting(state: PageState, now: float) -> dict[str, Any]:
    """Return a moment for the history of pages that open later, without what changes all the time."""
    shown = moment(state, "", now)
    operator = {**shown["operator"], "age": None}
    return {"switch": shown["switch"], "operator": operator, "engines": {"state": shown["engines"]["state"]}}


def _row(name: str, state: PageState, now: float) -> dict[str, Any]:
    """Return the row of a program; if two hosts run it, that of the host where it has a problem."""
    known = {host: program for (host, each), program in sorted(state.programs.items()) if each == name}
    present = {
        host: program
        for host, program in known.items()
        if now - max(program.heard, program.observed) <= HEALTH_TIMEOUT
    }
    programs = present or known or {"": Program()}
    rows = [_row_of(name, program, now, state.loopback_is_up) for program in programs.values()]
    worst = min(rows, key=lambda row: bool(row["ok"] and row["state"] == "RUNNING"))
    there_are_several = len({host for host, _ in state.programs}) > 1
    return worst | {"host": ", ".join(programs) if there_are_several else ""}


def _row_of(name: str, program: Program, now: float, loopback_is_up: bool) -> dict[str, Any]:
    # The health of the sentinel, which reports that the loopback interface is down, cannot be heard then.
    problem = f"loopback: {LOOPBACK_DOWN}" if name == manifest.sentinel() and not loopback_is_up else ""
    silence = now - program.heard
    return {
        "name": name,
        "state": program.state if now - program.observed <= HEALTH_TIMEOUT else "UNKNOWN",
        "pid": program.pid,
        "restarts": program.restarts,
        "output": program.output,
        "ok": program.ok and silence <= HEALTH_TIMEOUT and not problem,
        "health": problem or _health(program, silence),
    }


def _health(program: Program, silence: float) -> str:
    if silence <= HEALTH_TIMEOUT:
        return program.reason
    return f"no health for {math.floor(silence)} s" if math.isfinite(silence) else "no health yet"


class Updates:
    """The messages to one page: each shows what has changed since the last one."""

    def __init__(self, page: str, clock: Clock) -> None:
        self._page = page
        self._clock = clock
        self._shown: dict[str, Any] = {}
        self._samples = self._lines = self._refusals = 0

    def update(self, state: PageState, nonce: str, now: float) -> dict[str, Any]:
        """Return the next update of a page: what has changed, and the newest lines and samples."""
        shown = view(state, self._page, now)
        changes = {key: value for key, value in shown.items() if self._shown.get(key, self) != value}
        self._shown = shown
        if samples := state.arm.samples.since(self._samples):
            changes["trace"] = samples
        if lines := state.lines.since(self._lines):
            changes["lines"] = lines
        self._samples, self._lines = state.arm.samples.total, state.lines.total
        return {"type": "update", "nonce": nonce, "time": round(self._clock.elapsed(), 3), **changes}

    def refusals(self, state: PageState) -> list[dict[str, str]]:
        """Return the new refusals of requests of the page, and once that its hold has ended."""
        latest, self._refusals = state.refusals.since(self._refusals), state.refusals.total
        ours = dict.fromkeys((request, reason) for page, request, reason in latest if page == self._page)
        return [
            {"type": "released", "why": reason}
            if request == BEAT
            else {"type": "refused", "request": request, "why": reason}
            for request, reason in ours
        ]
