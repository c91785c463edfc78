from __future__ import annotations

import pytest

from deploy.operator.holder import Holder
from interfaces.topics import LONGEST_NAME


def test_no_hand_holds_at_the_beginning() -> None:
    assert Holder().name(0.0) is None
    assert Holder().words(0.0) == "Released"


@pytest.mark.parametrize(
    ("age", "words"), [(0.0, "Held by robot"), (0.25, "Held by robot"), (0.251, "Released")]
)
def test_heartbeat_shows_a_hand_for_250_ms(age: float, words: str) -> None:
    assert Holder(reported={"robot": 8.0}).beats(8.0).words(8.0 + age) == words


@pytest.mark.parametrize(("age", "words"), [(0.0, "Held by robot"), (0.5, "Held by robot"), (0.501, "Held")])
def test_report_names_the_hand_for_500_ms(age: float, words: str) -> None:
    assert Holder(heartbeat=8.0 + age).reports("robot", 8.0).words(8.0 + age) == words


def test_latest_report_names_the_hand() -> None:
    holder = Holder(heartbeat=8.0).reports("z", 7.8).reports("b", 7.9).reports("a", 8.0)
    assert holder.name(8.0) == "a"
    assert holder.reports("b", 8.1).name(8.1) == "b"


def test_terminal_is_named_without_its_number() -> None:
    assert Holder(heartbeat=8.0).reports("terminal_7", 8.0).name(8.0) == "terminal"
    assert Holder(heartbeat=8.0).reports("terminals", 8.0).name(8.0) == "terminals"


def test_own_hand_is_left_to_the_caller() -> None:
    holder = Holder(heartbeat=8.0)
    assert holder.name(8.0, own="page") == ""
    holder = holder.reports("page", 8.0)
    assert holder.name(8.0, own="page") is None
    assert holder.reports("robot", 7.9).name(8.0, own="page") == "robot"


def test_long_name_is_cut() -> None:
    holder = Holder(heartbeat=8.0).reports(10 * LONGEST_NAME * "n", 8.0)
    assert holder.name(8.0) == LONGEST_NAME * "n"
