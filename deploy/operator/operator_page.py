"""The operator's page: shows the arm in a browser, and is a hold-to-run switch.

User story (ours): as a robot operator, I see in a browser what the arm does and why its engines are off.
While my hand holds the page, I count as alive; when hand, page, browser or network go away, the engines stop.
"""

from __future__ import annotations

import os
import ssl
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import reactivex as rx
from reactivex import Observable
from reactivex.abc import SchedulerBase
from reactivex.subject import BehaviorSubject, Subject

from deploy.operator import hold
from deploy.operator.lines import line_batches
from deploy.operator.page import address, protocol, requests, server, state
from deploy.operator.page.history import SPAN
from deploy.operator.page.records import Records
from deploy.operator.page.site import Site
from deploy.operator.remote import PARAMETER_EVENTS, parameter_changes
from deploy.operator.strikes import new_watchdogs
from deploy.operator.switch import Switch
from deploy.supervision import manifest, processes
from deploy.supervision.reaction import reaction
from deploy.supervision.run_directory import RECORDS
from interfaces import hand, service, topics
from interfaces.loopback import loopback_is_up
from interfaces.plain_text import plain
from interfaces.service import ServiceNode, UserError, parameter
from interfaces.service.epoch import Epoch
from services import engine_controller, operator_watchdog

LINGER = SPAN  # s after the last page has left until its topics are given up: the next one shows this time
LINES_PERIOD = 0.5  # s
LOOPBACK_PERIOD = 1.0  # s


@dataclass(frozen=True)
class Parameters:
    port: int = parameter(
        address.DEFAULT_PORT,
        (0, 65535),
        "",
        "TCP port of the page; one of the next if this default is taken; 0 for no page",
    )
    address: str = parameter(
        "127.0.0.1", None, "", "IPv4 address to listen on; others than loopback need TLS"
    )
    names: str = parameter("", None, "", "names of the host in browsers, separated by spaces")
    certificate: str = parameter("", None, "", "file of the TLS certificate")
    key: str = parameter("", None, "", "file of the key of the certificate")


@dataclass(frozen=True)
class _Parameters:
    settings: str = parameter("", None, "", "folder that keeps the address of the page, or empty")
    silence: float = parameter(operator_watchdog.DEFAULTS.silence, None, "s", "of the operator watchdog")
    strikes: int = parameter(operator_watchdog.DEFAULTS.strikes, None, "", "of the operator watchdog")
    max_presence_age: float = parameter(
        engine_controller.DEFAULTS.max_presence_age, None, "s", "of the engine controller"
    )
    presence_timeout: float = parameter(
        engine_controller.DEFAULTS.presence_timeout, None, "s", "of the engine controller"
    )


def wire(node: ServiceNode) -> None:
    """Connect the pages with topics, parameters and processes."""
    parameters, given = node.declare(Parameters), node.declare(_Parameters)
    tls = address.tls(parameters.address, parameters.certificate, parameters.key)
    epoch = Epoch(node)
    clock = state.Clock(
        hold.monotonic, node.age, lambda: epoch.elapsed() if epoch.is_known else 0.0, node.stamp_age
    )
    initial = state.PageState(
        strikes=given.strikes,
        max_presence_age=given.max_presence_age,
        silence=given.silence,
        presence_timeout=given.presence_timeout,
    )
    newest = BehaviorSubject(initial)

    # What pages do: they open, hold the switch, and ask for something
    events: Subject[server.Event] = Subject()
    is_open = pages_are_open(events, node.scheduler).share()
    parameter_events = node.observe(PARAMETER_EVENTS)
    set_elsewhere = during(is_open, parameter_changes(parameter_events, node.get_namespace())).share()
    hands = only(events, hold.Press, hold.Beat, hold.Release)
    switch = Switch(node, hands, set_elsewhere, clock.now)
    asked = only(events, server.Request).share()
    node.publish(topics.ENGINES, requests.engine_commands(asked))
    configuration = requests.Configuration(node)
    signals = asked.filter(lambda it: isinstance(it.message, protocol.Process))

    # What is observed, with one reader of each topic for state and lines
    observed = {topic.name: node.observe(topic, timestamped=True).share() for topic in topics.CONTRACT}

    def seen(topic: topics.Topic) -> Observable[Any]:
        return observed[topic.name]

    ticks = rx.interval(LINES_PERIOD, node.scheduler)
    lines = line_batches(seen, ticks, node.get_namespace())

    # What pages show
    changes = rx.merge(
        state.always(seen, new_watchdogs(node, first_is_new=not epoch.is_past), clock),
        during(is_open, state.while_open(seen, lines, node.get_namespace(), clock)),
        switch.holds.map(state.held),
        during(is_open, loopback(node)).map(state.connected),
        configuration.followers(set_elsewhere, is_open),
        configuration.outcomes(asked),
        signals.flat_map(lambda it: requests.send_signal(it, newest.value.programs)),
    )
    # A scheduler would subscribe to one part of the recipe after another, and the first page may be faster.
    state.page_states(changes, initial).subscribe(newest.on_next, node.fail)
    beats = hold.heartbeats(switch.holds).share()
    node.publish(topics.OPERATOR_HEARTBEAT, beats)
    node.publish(topics.OPERATOR_HAND, hand.headers(beats, node.get_name()))
    requests.faults(asked).subscribe(lambda text: node.get_logger().error(f"a page: {plain(text)}"))
    violations = only(events, server.Violation).flat_map(lambda it: rx.repeat_value(it.reason, it.times))
    violations.subscribe(lambda reason: node.health.drop("page", reason))

    def receive(event: server.Event) -> None:
        node.scheduler.schedule(lambda *_: events.on_next(event))

    serve(node, parameters, given, tls, receive, lambda: newest.value, clock)


def only(events: Observable[Any], *kinds: type) -> Observable[Any]:
    return events.filter(lambda event: isinstance(event, kinds))


def pages_are_open(events: Observable[server.Event], scheduler: SchedulerBase) -> Observable[bool]:
    """Emit ``True`` when the first page opens, ``False`` ``LINGER`` [s] after the last page has closed."""
    opened = only(events, server.Opened, server.Closed).map(lambda it: isinstance(it, server.Opened))
    are_open = opened.scan(lambda count, opens: count + (1 if opens else -1), 0).map(bool)
    lingering = are_open.distinct_until_changed().debounce(LINGER, scheduler)
    return rx.merge(are_open.filter(bool), lingering).distinct_until_changed()


def during(is_open: Observable[bool], items: Observable[Any]) -> Observable[Any]:
    return is_open.switch_map(lambda it: items if it else rx.never())


def loopback(node: ServiceNode) -> Observable[bool]:
    """Emit whether the loopback interface is up."""
    looks = rx.timer(0.0, LOOPBACK_PERIOD, node.scheduler)
    return looks.map(lambda _: loopback_is_up()).distinct_until_changed()


def serve(
    node: ServiceNode,
    parameters: Parameters,
    given: _Parameters,
    tls: ssl.SSLContext | None,
    receive: Callable[[server.Event], None],
    newest: Callable[[], state.PageState],
    clock: state.Clock,
) -> None:
    """Serve the page until the node ends, and note its address; say so if that is not possible."""
    if not parameters.port:
        return
    file = address.AddressFile(given.settings)
    last_port, token = file.read()
    try:
        listener = address.listen(parameters.address, parameters.port, last_port)
    except OSError as error:
        note(node, file, f"No page: {error}")
        node.remark("page", str(error))
        return
    port = listener.getsockname()[1]
    names = address.host_names(parameters.address, parameters.names.split())
    scheme = "https" if tls else "http"
    run = os.environ.get(processes.MARK)
    pages = server.PageServer(
        listener,
        Site(token, names, scheme),
        Records(Path(run) / RECORDS if run else None, clock.elapsed),
        welcome=welcome(given),
        receive=receive,
        newest=newest,
        clock=clock,
        fail=node.fail,
        tls=tls,
    )
    # rclpy keeps a bound method by a weak reference: it would go while rclpy walks through its callbacks.
    node.context.on_shutdown(partial(pages.close))
    note(node, file, f"The page: {scheme}://{names[0]}:{port}/#{token}")


def note(node: ServiceNode, file: address.AddressFile, line: str) -> None:
    """Write the line for the user; a full disk is no reason to end."""
    try:
        file.write(line)
    except UserError as error:
        node.remark("page", str(error))


def welcome(given: _Parameters) -> dict[str, Any]:
    of_this_arm = reaction({"engine_controller": {"presence_timeout": given.presence_timeout}})
    return {
        "programs": protocol.PROGRAMS,
        "limits": protocol.LIMITS,
        "strikes": given.strikes,
        "silence": given.silence,
        "presence_timeout": given.presence_timeout,
        "on_lasts": topics.ENGINES_STATE.qos.lifespan.nanoseconds / 1e9,
        "off_within": of_this_arm.off_within,
        "beat": server.UPDATE_PERIOD,
        "max_nonce_age": hold.MAX_NONCE_AGE,
    }


if __name__ == "__main__":
    service.run(manifest.PAGE, wire)
