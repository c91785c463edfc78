from __future__ import annotations

import math
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.operator.hold import (
    ELSEWHERE,
    MAX_NONCE_AGE,
    OTHER_PAGE,
    TOO_LATE,
    Beat,
    Event,
    Hold,
    Nonces,
    Press,
    Release,
    heartbeats,
    holds,
    monotonic,
    step,
)
from reactive_node.testing import VirtualTime

A, B = "page a", "page b"
HELD = Hold(A, 100.0)


@pytest.mark.parametrize(
    ("hold", "event", "now", "expected"),
    [
        (Hold(), Press(A, 100.0), 100.1, Hold(A, 100.1, alive=True, pressed=True)),
        (Hold(), Press(A, 100.0), 100.25, Hold(A, 100.25, alive=True, pressed=True)),
        (Hold(), Press(A, 100.0), 100.26, Hold(refused=(A, TOO_LATE))),
        (Hold(), Press(A, -math.inf), 100.0, Hold(refused=(A, TOO_LATE))),
        (Hold(), Beat(A, 100.0), 100.0, Hold(ended=(A, ELSEWHERE))),
        (Hold(), Release(A), 100.0, Hold()),
        (HELD, Press(A, 100.0), 100.1, Hold(A, 100.1, alive=True)),
        (HELD, Press(A, 99.0), 100.1, Hold(refused=(A, TOO_LATE))),
        (HELD, Press(B, 100.0), 100.1, Hold(A, 100.0, refused=(B, OTHER_PAGE))),
        (HELD, Press(B, 100.2), 100.26, Hold(B, 100.26, alive=True, pressed=True)),
        (HELD, Beat(A, 100.0), 100.25, Hold(A, 100.25, alive=True)),
        (HELD, Beat(A, 99.89), 100.2, Hold(ended=(A, "a beat came 310 ms late"))),
        (HELD, Beat(A, -math.inf), 100.2, Hold(ended=(A, "a beat came more than 250 ms late"))),
        (HELD, Beat(A, 100.2), 100.26, Hold(ended=(A, "no beat came for 260 ms"))),
        (HELD, Beat(B, 100.0), 100.1, Hold(A, 100.0, ended=(B, ELSEWHERE))),
        (HELD, Release(A), 100.1, Hold()),
        (HELD, Release(B), 100.1, Hold(A, 100.0)),
        (HELD, Release(), 100.1, Hold()),
    ],
)
def test_each_step_of_the_switch(hold: Hold, event: Event, now: float, expected: Hold) -> None:
    assert step(hold, event, now) == expected


def test_later_beats_do_not_change_why_the_hold_was_lost() -> None:
    late = step(HELD, Beat(A, 99.89), 100.2)
    assert step(late, Beat(A, 100.2), 100.25).ended == (A, "a beat came 310 ms late")
    assert step(late, Beat(B, 100.2), 100.25).ended == (B, ELSEWHERE)
    released = step(HELD, Release(), 100.1)
    assert step(released, Beat(A, 100.1), 100.15).ended == (A, ELSEWHERE)


def heartbeats_of(*events: tuple[float, Event]) -> list[float]:
    """Return when the events, each with its time, give a sign of life; nonces count for 25 s."""
    scheduler = VirtualTime()
    held = holds(scheduler.hot(*events), max_age=25, now=lambda: scheduler.clock)
    items = scheduler.record(heartbeats(held), until=1000).items
    assert all(pressed is True for _, pressed in items)
    return [time for time, _ in items]


def test_beats_of_a_held_page_are_heartbeats() -> None:
    beats = [(time, Beat(A, time - 5)) for time in (220, 230, 240)]
    released = (250, Release(A)), (260, Beat(A, 255))
    assert heartbeats_of((210, Press(A, 205)), *beats, *released) == [210, 220, 230, 240]


def test_events_of_another_page_are_no_heartbeats() -> None:
    others = (215, Press(B, 214)), (216, Beat(B, 215)), (217, Release(B))
    assert heartbeats_of((210, Press(A, 205)), *others, (220, Beat(A, 219))) == [210, 220]


def test_queued_beats_are_no_heartbeats() -> None:
    queued = [(300, Beat(A, time)) for time in range(215, 300, 5)]
    later = (305, Beat(A, 304)), (310, Press(A, 309))
    assert heartbeats_of((210, Press(A, 205)), *queued, *later) == [210, 310]


def test_one_stale_beat_latches_released() -> None:
    beats = [(time, Beat(A, time)) for time in range(231, 300, 10)]
    assert heartbeats_of((210, Press(A, 205)), (230, Beat(A, 204)), *beats) == [210]


def test_gap_between_beats_latches_released() -> None:
    beats = [(time, Beat(A, time)) for time in range(261, 400, 10)]
    assert heartbeats_of((210, Press(A, 210)), (235, Beat(A, 235)), *beats) == [210, 235]


_events = st.one_of(
    st.builds(Press, st.sampled_from([A, B]), st.floats(-1.0, 0.0)),
    st.builds(Beat, st.sampled_from([A, B]), st.floats(-1.0, 0.0)),
    st.builds(Release, st.sampled_from([A, B, ""])),
)


@given(st.lists(st.tuples(st.floats(0.0, 0.3), _events)))
def test_every_heartbeat_is_a_young_answer_of_one_held_page(history: list[tuple[float, Event]]) -> None:
    hold, now = Hold(), 100.0
    holder, last = "", -math.inf  # the page whose press counted, and its last heartbeat
    for passed, event in history:
        now += passed
        if isinstance(event, Press | Beat):
            event = event._replace(sent=now + event.sent)  # the strategy draws ages
        hold = step(hold, event, now)
        if isinstance(event, Release):
            ends = event.page in ("", holder)
        else:
            ends = event.page == holder and now - event.sent > MAX_NONCE_AGE
        if ends:
            holder = ""
        if not hold.alive:
            continue
        assert isinstance(event, Press | Beat)
        assert now - event.sent <= MAX_NONCE_AGE
        if event.page != holder or now - last > MAX_NONCE_AGE:
            assert isinstance(event, Press), "only a press begins to hold"
            assert not holder or now - last > MAX_NONCE_AGE, "another page held"
        holder, last = event.page, now
        assert hold.holder(now) == holder


def test_nonce_is_known_while_it_is_young() -> None:
    nonces = Nonces()
    old, young = nonces.issue(10.0), nonces.issue(10.2)
    newest = nonces.issue(10.3)

    assert [nonces.sent(nonce) for nonce in (old, young, newest, "guess")] == [
        -math.inf,
        10.2,
        10.3,
        -math.inf,
    ]


def test_nonce_is_known_as_long_as_it_counts() -> None:
    nonces = Nonces()
    nonce = nonces.issue(20.0)
    nonces.issue(20.0 + MAX_NONCE_AGE)
    assert nonces.sent(nonce) == 20.0


def test_nonces_take_no_more_room_with_time() -> None:
    nonces = Nonces()
    known = [nonces.issue(0.05 * tick) for tick in range(1000)]

    assert len({*known}) == 1000
    assert sum(nonces.sent(nonce) > -math.inf for nonce in known) <= 6


def test_clock_of_the_nonces_counts_while_the_machine_sleeps(monkeypatch: pytest.MonkeyPatch) -> None:
    awake = {time.CLOCK_MONOTONIC: 100.0, time.CLOCK_BOOTTIME: 100.0 + 8 * 3600.0}  # it slept for 8 h
    monkeypatch.setattr(time, "clock_gettime", awake.__getitem__)
    monkeypatch.setattr(time, "monotonic", lambda: awake[time.CLOCK_MONOTONIC])
    assert monotonic() == 100.0 + 8 * 3600.0
