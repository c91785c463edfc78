"""What pages ask for besides the switch: the engines, the configuration, the processes."""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import reactivex as rx
from reactivex import Observable

from deploy.operator.page import protocol
from deploy.operator.page.server import Request
from deploy.operator.page.state import Change, Program, follows_scenario, refuse
from deploy.operator.remote import ParameterChange, RemoteParameters
from deploy.supervision import processes
from reactive_node import ReactiveNode

VALUE, FOLLOW_SCENARIO = "value", "follow_scenario"  # parameters of a source of the configuration
MOST_FAULTS = 50
SIGNALS = {"kill": signal.SIGKILL, "stop": signal.SIGSTOP}


def engine_commands(requests: Observable[Request]) -> Observable[str]:
    """Emit the commands to the engines."""
    messages = requests.map(lambda request: request.message)
    commands = messages.filter(lambda it: isinstance(it, protocol.Engines))
    return commands.map(lambda it: str(it.command))


def faults(requests: Observable[Request]) -> Observable[str]:
    """Emit each error of a page once; the first ones, as a log is no place for a flood."""
    messages = requests.map(lambda request: request.message)
    texts = messages.filter(lambda it: isinstance(it, protocol.Fault)).map(lambda it: str(it.text))
    return texts.distinct().take(MOST_FAULTS)


class Configuration:
    """The sources of the configuration: set by hand on a page, or given back to the scenario."""

    def __init__(self, node: ReactiveNode) -> None:
        self._programs = {f"config_{name}": name for name in protocol.LIMITS}
        self._sources = {name: RemoteParameters(node, program) for program, name in self._programs.items()}

    def outcomes(self, requests: Observable[Request]) -> Observable[Change]:
        """Set the sources as pages ask; emit what has come of it."""
        ours = requests.filter(lambda it: isinstance(it.message, protocol.Set | protocol.FollowScenario))
        # A slider that moves asks faster than its source answers: the newest value counts.
        by_source = ours.group_by(lambda it: getattr(it.message, "name", ""))
        return by_source.flat_map(lambda requests: requests.switch_map(self._carry_out))

    def _carry_out(self, request: Request) -> Observable[Change]:
        match request.message:
            case protocol.Set(name, value):
                kind, settings = "set", [(name, VALUE, value)]
            case _:
                kind, settings = "follow_scenario", [(name, FOLLOW_SCENARIO, True) for name in self._sources]

        def outcome(name: str, parameter: str, reason: str) -> Change:
            if reason:
                return refuse(request.page, kind, reason)
            # The event of the same change may come before its reader has met the source.
            return follows_scenario(name, parameter == FOLLOW_SCENARIO)

        outcomes = (
            self._sources[name].set(parameter, value).map(partial(outcome, name, parameter))
            for name, parameter, value in settings
        )
        return rx.merge(*outcomes).catch(lambda error, _: rx.just(refuse(request.page, kind, str(error))))

    def followers(
        self, changes: Observable[ParameterChange], is_open: Observable[bool]
    ) -> Observable[Change]:
        """Emit for each source whether it follows the scenario: when a page opens, and on each change."""
        asked = is_open.filter(bool).flat_map(lambda _: rx.merge(*map(self._ask, self._sources)))
        ours = changes.filter(lambda it: it.program in self._programs and it.name == FOLLOW_SCENARIO)
        return rx.merge(asked, ours.map(lambda it: follows_scenario(self._programs[it.program], it.value)))

    def _ask(self, name: str) -> Observable[Change]:
        answer = self._sources[name].get(FOLLOW_SCENARIO).catch(rx.empty())
        return answer.map(lambda follows: follows_scenario(name, follows))


def send_signal(request: Request, programs: Mapping[tuple[str, str], Program]) -> Observable[Change]:
    """Kill or stop a process of this host as a page asks; emit the refusal if that is not possible."""
    assert isinstance(request.message, protocol.Process)
    name, action = request.message
    run = os.environ.get(processes.MARK)
    pid = programs.get((socket.gethostname(), name), Program()).pid
    if not request.is_local:
        reason = "only pages on the machine of the arm may do this"
    elif run is None:
        reason = "the page runs without supervisord: it knows no processes"
    elif not processes.send_signal(Path(run), name, pid, SIGNALS[action]):
        reason = f"{name} has no process on this host now"
    else:
        return rx.empty()
    return rx.just(refuse(request.page, "process", reason))
