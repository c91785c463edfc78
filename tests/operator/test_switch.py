"""How the pages take the switch, against a dead man's switch that answers when the test wants."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
from reactivex import Observable
from reactivex.disposable import Disposable
from reactivex.subject import Subject

from deploy.operator import switch
from deploy.operator.hold import Event, Hold, Press
from deploy.operator.remote import ParameterChange
from deploy.operator.switch import VIRTUAL_SWITCH, Switch


class Page:
    def get_name(self) -> str:
        return "page"


class Remote:
    """Requests that wait for an answer."""

    def __init__(self, node: Page, program: str) -> None:
        assert program == VIRTUAL_SWITCH
        requests.clear()

    def set_together(self, values: Mapping[str, Any]) -> Observable[str]:
        def subscribe(observer: Any, scheduler: Any = None) -> Disposable:
            requests.append((values, observer))
            return Disposable(lambda: requests.remove((values, observer)))

        return Observable(subscribe)


requests: list[tuple[Mapping[str, Any], Any]] = []


class Pages:
    def __init__(self) -> None:
        self.events: Subject[Event] = Subject()
        self.changes: Subject[ParameterChange] = Subject()
        self.holds: list[Hold] = []
        node: Any = Page()
        self.switch = Switch(node, self.events, self.changes, lambda: 100.0)
        self.switch.holds.subscribe(self.holds.append)

    def set_by(self, hand: str, pressed: bool, program: str = VIRTUAL_SWITCH, name: str = "pressed") -> None:
        self.changes.on_next(ParameterChange(program, name, pressed, {name: pressed, "hand": hand}))


@pytest.fixture
def pages(monkeypatch: pytest.MonkeyPatch) -> Pages:
    monkeypatch.setattr(switch, "RemoteParameters", Remote)
    pages = Pages()
    pages.events.on_next(Press("a", 100.0))
    return pages


def test_press_takes_the_switch_until_it_answers(pages: Pages) -> None:
    ((values, asked),) = requests
    assert values["pressed"] is False
    asked.on_error(TimeoutError())
    ((again, asked),) = requests
    assert again == values
    asked.on_next("")
    asked.on_completed()
    assert requests == []
    assert [it.page for it in pages.holds] == ["a"]


@pytest.mark.parametrize("pressed", [True, False])
def test_another_hand_releases_a_page_and_ends_its_take(pages: Pages, pressed: bool) -> None:
    pages.set_by("terminal_7", pressed)

    assert pages.holds[-1] == Hold()
    assert requests == []
    pages.events.on_next(Press("a", 100.0))
    assert len(requests) == 1


def test_hand_of_the_same_name_on_another_host_is_another_hand(pages: Pages) -> None:
    ((_, asked),) = requests
    asked.on_next("")
    asked.on_completed()
    Pages().events.on_next(Press("b", 100.0))
    ((values, _),) = requests
    pages.changes.on_next(ParameterChange(VIRTUAL_SWITCH, "pressed", False, values))

    assert pages.holds[-1] == Hold()


def test_what_is_set_by_the_page_or_concerns_no_switch_ends_nothing(pages: Pages) -> None:
    ((values, _),) = requests
    pages.set_by(values["hand"], False)
    pages.set_by("terminal_7", False, program="kinematics")
    pages.set_by("terminal_7", False, name="rate")

    assert [it.page for it in pages.holds] == ["a"]
    assert len(requests) == 1
