from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import reactivex as rx
from rclpy.task import Future
from reactivex import Observable
from std_msgs.msg import String
from std_srvs.srv import SetBool

from interfaces.service import Rejected, UserError
from interfaces.topics import DRIVE_TIMEOUT, ENGINES_STATE, OFF, ON
from reactive_node.testing import MakeNode, SpinUntil, VirtualTime
from services.examples import drive_adapter
from services.examples.drive_adapter import orders
from tests.component.wiring import Connect, Wired


class Drive:
    """A drive that needs some time [s] to obey, and refuses what it shall refuse."""

    def __init__(self, delay: float = 0.0, refuses: Callable[[bool], bool] = lambda on: False) -> None:
        self.ordered: list[bool] = []
        self._delay = delay
        self._refuses = refuses

    def order(self, on: bool) -> Observable[None]:
        def begin(_: Any) -> Observable[Any]:
            self.ordered.append(on)
            if self._refuses(on):
                return rx.throw(RuntimeError("it is stuck"))
            return rx.timer(self._delay).map(lambda _: "an answer")

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
    found = obeyed(drive, (0.05, True), (0.25, True), (0.45, False), (0.55, True), until=0.7)
    reason = "the drive does not obey: it is stuck"
    states = [it for _, it in found]
    assert states[:2] == [False, reason]
    assert set(states[2:-2]) == {False}
    assert states[-2:] == [True, True]


def test_reason_is_reported_while_the_drive_stays_off() -> None:
    drive = Drive(refuses=bool)
    found = obeyed(drive, (0.05, True), (1.3, False), until=1.9)
    reason = "the drive does not obey: it is stuck"
    assert [round(at, 1) for at, it in found if it == reason] == [0.1, 0.6, 1.1]
    assert sum(it is False for at, it in found if at < 1.3) > 10  # and it is ordered off meanwhile


def test_off_that_fails_is_tried_again() -> None:
    offs = iter([True, True, False])
    reason = "the drive does not obey: it is stuck"
    found = obeyed(Drive(refuses=lambda on: next(offs)), until=0.25)
    assert found == [(0.0, reason), (0.1, reason), (0.2, False)]


def start(connect: Connect, **parameters: Any) -> Wired:
    wired = connect(drive_adapter.wire, inputs=[ENGINES_STATE], **parameters)
    wired.publish(ENGINES_STATE, String(data=OFF))
    return wired


def test_file_follows_the_engines_and_is_off_at_the_end(
    connect: Connect, spin_until: SpinUntil, tmp_path: Path
) -> None:
    pin = tmp_path / "value"
    pin.write_text("1\n")
    wired = start(connect, file=str(pin))
    spin_until(lambda: pin.read_text() == "0\n")

    def turned_on() -> bool:
        wired.publish(ENGINES_STATE, String(data=ON))
        return pin.read_text() == "1\n"

    spin_until(turned_on)
    spin_until(lambda: pin.read_text() == "0\n")  # nobody repeats the `on`
    assert wired.remarks() == []
    assert int(wired.reports()[-1]["published"]) > 2  # orders
    spin_until(turned_on)
    wired.service.destroy_node()

    assert pin.read_text() == "0\n"


def test_file_is_off_before_the_service_spins(connect: Connect, tmp_path: Path) -> None:
    pin = tmp_path / "value"
    pin.write_text("1\n")
    start(connect, file=str(pin))
    assert pin.read_text() == "0\n"


def obedient_driver(make_node: MakeNode) -> list[bool]:
    """Serve a drive that does what it is asked for; return what that was."""
    asked: list[bool] = []

    def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        asked.append(request.data)
        response.success = True
        return response

    make_node("driver").create_service(SetBool, "motor", answer)
    return asked


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of rclpy: the client is gone before the answer
def test_service_and_file_follow_the_engines_and_are_off_at_the_end(
    connect: Connect, make_node: MakeNode, spin_until: SpinUntil, tmp_path: Path
) -> None:
    pin = tmp_path / "value"
    pin.write_text("1\n")
    asked = obedient_driver(make_node)
    wired = start(connect, service="motor", file=str(pin))

    def are(on: bool) -> bool:
        return (asked[-1:], pin.read_text()) == ([on], f"{on:d}\n")

    def turned_on() -> bool:
        wired.publish(ENGINES_STATE, String(data=ON))
        return are(True)

    spin_until(lambda: are(False))
    spin_until(turned_on)
    spin_until(lambda: are(False))
    spin_until(turned_on)
    count = len(asked)
    wired.service.destroy_node()
    spin_until(lambda: len(asked) > count and are(False))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of rclpy: the client is gone before the answer
@pytest.mark.parametrize(
    ("order", "message", "words"),
    [
        (True, "brake of axis 2 is stuck", "motor refused on: brake of axis 2 is stuck"),
        (False, "", "motor refused off"),
    ],
)
def test_words_of_a_driver_that_refuses_are_reported(
    connect: Connect, make_node: MakeNode, spin_until: SpinUntil, order: bool, message: str, words: str
) -> None:
    def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.success = request.data != order
        response.message = "" if response.success else message
        return response

    make_node("driver").create_service(SetBool, "motor", answer)
    wired = start(connect, service="motor")
    why = f"engines/state: the drive does not obey: {words}"

    def is_reported() -> bool:
        wired.publish(ENGINES_STATE, String(data=ON))
        return why in wired.remarks()

    spin_until(is_reported)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of rclpy: the client is gone before the answer
def test_drive_that_does_not_answer_is_ordered_off_within_its_timeout(
    connect: Connect, make_node: MakeNode, spin_until: SpinUntil
) -> None:
    asked: list[tuple[bool, float]] = []

    async def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        asked.append((request.data, time.monotonic()))
        if request.data:
            await Future()  # for ever
        response.success = True
        return response

    make_node("driver").create_service(SetBool, "motor", answer)
    wired = start(connect, service="motor")
    why = f"engines/state: the drive does not obey: no response of motor within {DRIVE_TIMEOUT} s"

    def is_reported() -> bool:
        wired.publish(ENGINES_STATE, String(data=ON))  # it stays permitted
        return any(why in remark for remark in wired.remarks())

    begin = time.monotonic()
    spin_until(is_reported)
    on = next(n for n, (order, _) in enumerate(asked) if order)
    # On a busy machine, another `on` may take the place of an `off` that was not read yet.
    spin_until(lambda: any(not order for order, _ in asked[on:]))
    off = next(at for order, at in asked[on:] if not order)
    assert off - begin >= DRIVE_TIMEOUT


def test_drive_whose_file_has_gone_ends_in_order(
    connect: Connect, spin_until: SpinUntil, tmp_path: Path
) -> None:
    pin = tmp_path / "value"
    pin.write_text("1\n")
    wired = start(connect, file=str(pin))
    pin.unlink()
    gone = f"the drive does not obey: file: {pin} cannot be written: No such file or directory"
    spin_until(lambda: any(gone in remark for remark in wired.remarks()))
    wired.service.destroy_node()


@pytest.mark.parametrize(
    ("parameters", "problem"),
    [
        ({}, "no drive: set the parameter service or file"),
        ({"file": "/no/pin"}, "file: /no/pin cannot be written: No such file"),
    ],
)
def test_missing_drive_is_refused(connect: Connect, parameters: dict[str, str], problem: str) -> None:
    with pytest.raises(UserError, match=f"^{problem}"):
        start(connect, **parameters)
