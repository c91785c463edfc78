"""The dead man's switch: a virtual operator holds it (thesis 5.2.3).

User story (ours): as a developer, I am able to hold and release the switch, by hand
(``ros2 param set /dead_mans_switch pressed true``) or along a scenario, which may also ask for the engines.
"""

from __future__ import annotations

from dataclasses import dataclass

import reactivex as rx
from reactivex import Observable
from std_msgs.msg import Bool, String

from interfaces import service
from interfaces.scenario.source import VirtualSource
from interfaces.service import ServiceNode, parameter
from interfaces.topics import ENGINES, ENGINES_STATE, OFF, ON, OPERATOR_HEARTBEAT, TURN_ON


def heartbeats(
    pressed: Observable[bool], rate: Observable[float], single: Observable[bool]
) -> Observable[bool]:
    """Emit ``True`` at ``rate`` [Hz] while the switch is pressed, and at every ``single`` press beside
    that."""

    def beats(state: tuple[bool, float]) -> Observable[bool]:
        is_pressed, rate = state
        return rx.interval(1.0 / rate).map(lambda _: True) if is_pressed else rx.never()

    return rx.merge(rx.combine_latest(pressed, rate).switch_map(beats), single)


def insisting(
    commands: Observable[str], states: Observable[str], *, patience: float = 1.0, times: int = 10
) -> Observable[str]:
    """
    Emit each command, and again every ``patience`` [s] until the engines obey, ``times`` times in all.

    So does a person whose command was lost, or came before the system was ready for it.
    """

    def insist(command: str) -> Observable[str]:
        wanted = ON if command == TURN_ON else OFF
        obeyed = states.filter(lambda state: state == wanted)
        return rx.timer(0.0, patience).take(times).map(lambda _: command).take_until(obeyed)

    return commands.switch_map(insist)


@dataclass(frozen=True)
class Parameters:
    """What a user may set."""

    rate: float = parameter(20.0, (1.0, 10_000.0), "Hz", "heartbeats while pressed", settable=True)
    pressed: bool = parameter(False, None, "", "whether the switch is pressed", settable=True)


def wire(node: ServiceNode) -> None:
    """Connect the recipes with their topics."""
    node.declare(Parameters)
    source = VirtualSource(node)
    scenario = source.scenario
    beats = heartbeats(
        source.follow("pressed", source.play(scenario.pressed)),
        source.follow("rate"),
        source.until_set("pressed", source.play(scenario.heartbeats, resume=False) or rx.never()),
    )
    node.publish(OPERATOR_HEARTBEAT, beats.map(lambda beat: Bool(data=beat)))

    commands = source.play(scenario.commands, resume=False)
    if commands is not None:
        states = node.observe(ENGINES_STATE).map(lambda state: state.data)
        node.publish(ENGINES, insisting(commands, states).map(lambda command: String(data=command)))


def main() -> None:
    """Run the service."""
    service.run("dead_mans_switch", wire)


if __name__ == "__main__":
    main()
