from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import reactivex as rx
from reactivex import Observable
from std_msgs.msg import String
from std_srvs.srv import SetBool

from interfaces.service import Rejected, UserError
from interfaces.topics import ENGINES_STATE, OFF, ON
from reactive_node.testing import MakeNode, SpinUntil, VirtualTime
from services.examples import drive_adapter
from services.examples.drive_adapter import orders
from tests.component.wiring import Wired


class Drive:
    """A drive that needs some time [s] to obey, and refuses what it is told to refuse."""

    def __init__(self, delay: float = 0.0, refuses: Callable[[bool], bool] = lambda on: False) -> None:
        self.ordered: list[bool] = []
        self._delay = delay
        self._refuses = refuses

    def order(self, on: bool) -> Observable[None]:
        def begin(_: Any) -> Observable[Any]:
            self.ordered.append(on)
            return rx.throw(RuntimeError("it is stuck")) if self._refuses(on) else rx.timer(self._delay)

        return rx.defer(begin)


def obeyed(drive: Drive, *permissions: tuple[float, bool], until: float) -> list[tuple[float, Any]]:
    """Return what the drive has obeyed, and the rejections, each with its time to a tenth."""
    scheduler = VirtualTime()
    recipe = orders(scheduler.hot(*permissions).start_with(False), drive.order)
    items = scheduler.record(recipe, until=until).items
    return [(round(at, 1), it.reason if isinstance(it, Rejected) else it) for at, it in items]


def test_drive_is_ordered_off_from_the_start_on() -> None:
    assert obeyed(Drive(), until=0.25) == [(0.0, False), (0.1, False), (0.2, False)]


def test_order_follows_the_permission_at_once_and_is_repeated() -> None:
    found = obeyed(Drive(), (0.15, True), (0.25, True), (0.45, False), until=0.5)
    assert [it for _, it in found] == [False, False, True, True, True, False]


def test_off_does_not_wait_for_the_answer_to_an_on() -> None:
    drive = Drive(delay=0.25)
    assert obeyed(drive, (0.1, True), (0.2, False), until=0.48) == [(0.5, False)]
    assert drive.ordered == [False, True, False]


def test_drive_that_fails_to_go_on_is_off_until_it_is_permitted_again() -> None:
    ons = iter([True, False, False])
    drive = Drive(refuses=lambda on: on and next(ons))
    found = obeyed(drive, (0.05, True), (0.45, False), (0.55, True), until=0.7)
    reason = "the drive does not obey: it is stuck"
    states = [it for _, it in found]
    assert states[:2] == [False, reason]
    assert set(states[2:-2]) == {False}
    assert states[-2:] == [True, True]


def test_off_that_fails_is_tried_again() -> None:
    offs = iter([True, True, False])
    reason = "the drive does not obey: it is stuck"
    found = obeyed(Drive(refuses=lambda on: next(offs)), until=0.25)
    assert found == [(0.0, reason), (0.1, reason), (0.2, False)]


def start(make_node: MakeNode, spin_until: SpinUntil, **parameters: Any) -> Wired:
    wired = Wired(make_node, spin_until, drive_adapter.wire, inputs=[ENGINES_STATE], outputs=[], **parameters)
    wired.publish(ENGINES_STATE, String(data=OFF))
    return wired


def test_file_follows_the_engines_and_is_off_at_the_end(
    make_node: MakeNode, spin_until: SpinUntil, tmp_path: Path
) -> None:
    pin = tmp_path / "value"
    pin.write_text("1\n")
    wired = start(make_node, spin_until, file=str(pin))
    spin_until(lambda: pin.read_text() == "0\n")

    def turned_on() -> bool:
        wired.publish(ENGINES_STATE, String(data=ON))
        return pin.read_text() == "1\n"

    spin_until(turned_on)
    spin_until(lambda: pin.read_text() == "0\n")  # nobody repeats the `on`
    spin_until(turned_on)
    wired.service.destroy_node()

    assert pin.read_text() == "0\n"


def test_file_is_off_before_the_service_spins(
    make_node: MakeNode, spin_until: SpinUntil, tmp_path: Path
) -> None:
    pin = tmp_path / "value"
    pin.write_text("1\n")
    start(make_node, spin_until, file=str(pin))
    assert pin.read_text() == "0\n"


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of rclpy: the client is gone before the answer
def test_service_follows_the_engines_and_is_off_at_the_end(
    make_node: MakeNode, spin_until: SpinUntil
) -> None:
    asked: list[bool] = []

    def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        asked.append(request.data)
        response.success = True
        return response

    make_node("driver").create_service(SetBool, "motor", answer)
    wired = start(make_node, spin_until, service="motor")
    spin_until(lambda: asked[-1:] == [False])

    def turned_on() -> bool:
        wired.publish(ENGINES_STATE, String(data=ON))
        return asked[-1]

    spin_until(turned_on)
    spin_until(lambda: not asked[-1])
    spin_until(turned_on)
    count = len(asked)
    wired.service.destroy_node()
    spin_until(lambda: len(asked) > count and not asked[-1])


@pytest.mark.parametrize(
    ("parameters", "problem"),
    [({}, "no drive: set the parameter service or file"), ({"file": "/no/pin"}, "file: /no/pin does not")],
)
def test_missing_drive_is_refused(
    make_node: MakeNode, spin_until: SpinUntil, parameters: dict[str, str], problem: str
) -> None:
    with pytest.raises(UserError, match=problem):
        start(make_node, spin_until, **parameters)
