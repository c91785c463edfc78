"""Which of several drives a joint follows."""

from __future__ import annotations

import itertools
import subprocess
import sys

import reactivex as rx
from hypothesis import given
from hypothesis import strategies as st

from interfaces.service import Rejected, host
from interfaces.sources.driving import followed
from interfaces.topics import DRIVEN_TIME, DrivenTime
from tests.users import needs_root


def played(*times: tuple[float, str]) -> list[float | str]:
    """Return what a joint of host "ours" plays of times, each with its host, or why it is rejected."""
    found: list[float | Rejected] = []
    reports = [DrivenTime(0, seconds, source, source) for seconds, source in times]
    followed(rx.from_iterable(reports), "ours").subscribe(found.append)
    return [each.reason if isinstance(each, Rejected) else each for each in found]


def test_times_of_its_own_drive_are_played() -> None:
    assert played((3.0, "ours"), (3.0, "ours"), (3.04, "ours")) == [3.0, 3.0, 3.04]


def test_a_joint_begins_with_the_first_time_of_its_drive() -> None:
    assert played((0.5, "ours")) == [0.5]


def test_long_name_of_another_host_is_cut() -> None:
    (rival,) = played((0.5, 100 * "x"))
    assert f"host {64 * 'x'} publishes" in str(rival)


def test_times_of_another_drive_are_rejected_and_named() -> None:
    rival = "the drive of host theirs publishes it, too: the joint follows that of its own host"
    assert played((9.0, "theirs"), (3.0, "ours"), (9.0, "theirs")) == [rival, 3.0, rival]


def test_joint_whose_drive_went_back_stands_until_it_has_caught_up() -> None:
    back = "it went back: the joint stands until it has caught up"
    assert played((3.0, "ours"), (0.0, "ours"), (2.9, "ours"), (3.0, "ours")) == [3.0, back, back, 3.0]


times = st.lists(st.tuples(st.floats(0.0, 100.0), st.sampled_from(["ours", "theirs", ""])))


@given(times)
def test_a_joint_never_goes_back_and_plays_only_its_own_drive(times: list[tuple[float, str]]) -> None:
    numbers = [each for each in played(*times) if isinstance(each, float)]

    assert all(one <= two for one, two in itertools.pairwise(numbers))
    assert {*numbers} <= {time for time, source in times if source == "ours"}


@given(st.floats(0.0, 1e9))
def test_order_of_times_survives_their_message(seconds: float) -> None:
    """After a restart, a drive publishes the time that it has kept: it must not seem to go back."""
    first, second = (
        DRIVEN_TIME.value(DRIVEN_TIME.message(DrivenTime(1, each, "ours", "desk")))
        for each in (seconds, seconds)
    )
    assert first == second
    assert abs(first.seconds - seconds) < 1e-6


def test_identity_of_a_host_stays() -> None:
    assert host.identity() == host.identity()
    assert len(host.identity()) == 16


@needs_root
def test_network_namespace_is_a_host_of_its_own() -> None:
    code = "from interfaces.service import host; print(host.identity())"
    here, there = (
        subprocess.run([*within, sys.executable, "-c", code], capture_output=True, text=True, check=True)
        for within in ([], ["unshare", "--net"])
    )
    assert here.stdout == f"{host.identity()}\n" != there.stdout
