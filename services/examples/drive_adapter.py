"""Turns a real drive on and off: by a service (std_srvs/SetBool), by a file, or by both.

User story (ours): as a robot operator, I find the drive off unless the engine controller has said `on` within
the last 400 ms: also when this process starts, when it ends, and when an order to the drive fails.

The order is repeated every 100 ms, or when the drive has answered, if that takes longer. A drive that stops
when the repetition ends is safe even while this process is killed or stopped; another one stays on until
supervisord has started the process again.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import reactivex as rx
from reactivex import Observable
from std_srvs.srv import SetBool

from interfaces import permission, service
from interfaces.drive_file import DriveFile
from interfaces.service import Rejected, ServiceNode, UserError, parameter
from interfaces.topics import DRIVE_TIMEOUT, ENGINES_STATE

REPEAT = 0.1  # s
REMIND = 0.5  # s: each report of health has the reason why the drive stays off
Order = Callable[[bool], Observable[Any]]
"""Orders a drive on or off; emits an item when it has obeyed, and ends in an error if it has not."""


def orders(permissions: Observable[bool], order: Order) -> Observable[bool | Rejected]:
    """Order the drive on while that is permitted, else off, at once and repeatedly; emit what it has obeyed.

    After an `on` that failed, the drive is off until it has been forbidden and permitted again.
    """

    def repeated(attempt: Observable[Any]) -> Observable[Any]:
        # A late answer delays the next repetition, not a change.
        return rx.timer(0.0, REPEAT).map(lambda _: attempt).exclusive()

    def rejected(error: Exception, _: Any = None) -> Observable[Any]:
        return rx.just(Rejected(ENGINES_STATE, f"the drive does not obey: {error}"))

    off = repeated(order(False).map(lambda _: False).catch(rejected))
    on = repeated(order(True).map(lambda _: True))

    def stay_off(error: Exception, _: Any) -> Observable[Any]:
        return rx.merge(rx.timer(0.0, REMIND).flat_map(lambda _: rejected(error)), off)

    safe = on.catch(stay_off)
    return permissions.distinct_until_changed().switch_map(lambda permitted: safe if permitted else off)


@dataclass(frozen=True)
class Parameters:
    service: str = parameter("", None, "", "name of the driver's service; empty for none")
    file: str = parameter("", None, "", "file, serial line or pipe that gets `1` or `0`; empty for none")


def wire(node: ServiceNode) -> None:
    parameters = node.declare(Parameters)
    if not parameters.service and not parameters.file:
        raise UserError("no drive: set the parameter service or file")

    def report(item: bool | Rejected) -> None:
        if isinstance(item, Rejected):
            node.reject(item)
        else:
            node.health.count_output()

    def connect(order: Order, turn_off: Callable[[], None]) -> None:
        permissions = permission.observe(node).finally_action(turn_off)  # the end of the node ends them
        orders(permissions, order).subscribe(report, node.fail, scheduler=node.scheduler)

    if parameters.file:
        file = DriveFile(parameters.file)
        file.write(False)  # at once: a signal may end this process before the recipe does so
        connect(lambda on: rx.from_callable(lambda: file.write(on)), file.leave)
    if parameters.service:
        call = node.create_call(SetBool, parameters.service, timeout=DRIVE_TIMEOUT)
        client = node.create_client(SetBool, parameters.service)

        def ask(on: bool) -> Observable[Any]:
            def obeyed(answer: Any) -> Any:
                if not answer.success:
                    why = f": {answer.message}" if answer.message else ""
                    raise RuntimeError(f"{parameters.service} refused {'on' if on else 'off'}{why}")
                return answer

            return call(SetBool.Request(data=on)).map(obeyed)

        def turn_off() -> None:
            client.call_async(SetBool.Request(data=False))  # a call would wait for the answer

        connect(ask, turn_off)


if __name__ == "__main__":
    service.run("drive_adapter", wire)
