"""The dead man's switch, held by a virtual operator (thesis 5.2.3).

User story (ours): as a developer, I am able to press and release the switch by a parameter
(``ros2 param set /dead_mans_switch pressed true``: it stays pressed without a hand) or by a scenario, which
may also command the engines until a person takes the switch.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import reactivex as rx
from reactivex import Observable

from interfaces import hand, service
from interfaces.service import ServiceNode, parameter
from interfaces.service.epoch import Epoch
from interfaces.sources.player import Player
from interfaces.sources.settings import Settings
from interfaces.topics import ENGINES, ENGINES_STATE, OFF, ON, OPERATOR_HAND, OPERATOR_HEARTBEAT, TURN_ON


def heartbeats(
    pressed: Observable[bool], rate: Observable[float], single: Observable[bool]
) -> Observable[bool]:
    """Emit ``True`` at ``rate`` [Hz] while the switch is pressed, and at each ``single`` heartbeat."""

    def beats(state: tuple[bool, float]) -> Observable[bool]:
        is_pressed, rate = state
        return rx.interval(1.0 / rate).map(lambda _: True) if is_pressed else rx.never()

    return rx.merge(rx.combine_latest(pressed, rate).switch_map(beats), single)


def engine_commands(
    wanted: Observable[str],
    states: Observable[str],
    heard: Observable[str],
    *,
    period: float = 1.0,
    times: int = 10,
) -> Observable[str]:
    """Emit each wanted command, and repeat it every ``period`` [s] until the engines obey, ``times`` in all.

    A person also tries again when the system was not ready for a command, but not against somebody else: the
    opposite command on the topic ends the repetition.
    """

    def attempts(command: str) -> Observable[str]:
        state = ON if command == TURN_ON else OFF
        obeyed = states.filter(lambda it: it == state)
        opposed = heard.filter(lambda it: it != command)
        return rx.timer(0.0, period).take(times).map(lambda _: command).take_until(rx.merge(obeyed, opposed))

    return wanted.switch_map(attempts)


@dataclass(frozen=True)
class Parameters:
    rate: float = parameter(20.0, (1.0, 10_000.0), "Hz", "heartbeats while pressed", settable=True)
    pressed: bool = parameter(
        False,
        None,
        "",
        "whether the switch is pressed: it stays so without a hand, for developers",
        settable=True,
    )
    hand: str = parameter("", None, "", "the node that has set `pressed`, by its own word", settable=True)


def wire(node: ServiceNode) -> None:
    node.declare(Parameters)
    epoch = Epoch(node)
    player, settings = Player(node, epoch), Settings(node, is_restart=epoch.is_past)
    scenario = player.scenario
    pressed, rate = settings.keep("pressed", if_lost=False), settings.keep("rate")
    single = pressed.until_set(player.events(scenario.heartbeats))
    # A record shows each rate that is set, because the judge compares the heartbeats with it.
    rates = rate.values.do_action(partial(node.health.note_parameter, "rate"))
    beats = heartbeats(pressed.instead_of(player.state(scenario.pressed)), rates, single).share()
    node.publish(OPERATOR_HEARTBEAT, beats)
    node.publish(OPERATOR_HAND, hand.headers(beats, node.get_name()))
    states, heard = map(node.observe, (ENGINES_STATE, ENGINES))
    commands = engine_commands(player.events(scenario.commands), states, heard)
    # A person who takes the switch replaces the virtual operator for the commands too.
    node.publish(ENGINES, pressed.until_set(commands))


if __name__ == "__main__":
    service.run("dead_mans_switch", wire)
