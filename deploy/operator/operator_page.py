"""The operator's page: shows the arm in a browser, and is a hold-to-run switch.

User story (ours): as a robot operator, I see in a browser what the arm does and why its engines are off.
While my hand holds the page, I count as alive; when hand, page, browser or network go away, the engines stop.
"""

from __future__ import annotations

import ssl
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import reactivex as rx
from rclpy.qos import QoSProfile, ReliabilityPolicy
from reactivex import Observable
from reactivex.abc import SchedulerBase
from reactivex.subject import BehaviorSubject, Subject

from deploy.operator import hold
from deploy.operator.engines import NOT_YET, OLDER, Engines, graph
from deploy.operator.lines import line_batches
from deploy.operator.page import address, protocol, requests, server, state
from deploy.operator.page.history import SPAN
from deploy.operator.page.site import Site
from deploy.operator.remote import parameter_changes
from deploy.operator.switch import VIRTUAL_SWITCH, Switch
from deploy.supervision import manifest
from deploy.supervision.reaction import reaction
from interfaces import service, topics
from interfaces.loopback import loopback_is_up
from interfaces.service import ServiceNode, UserError, parameter
from interfaces.service.epoch import Epoch
from interfaces.topics import TURN_OFF
from reactive_node import stamps
from services import engine_controller, operator_watchdog

LINGER = SPAN  # s after the last page has left until its topics are given up: the next one shows this time
LINES_PERIOD = 0.5  # s
TERMINALS_PERIOD = 0.5  # s
LOOPBACK_PERIOD = 1.0  # s
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
UNSEEN = replace(topics.ENGINES_STATE, qos=BEST_EFFORT)
"""The engines' state while no page shows it. To read and acknowledge it ten times a second would cost more
than the rest of this process."""
UNSEEN_PERIOD = 0.3  # s


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
    clock = state.Clock(hold.monotonic, node.age, lambda: epoch.elapsed() if epoch.is_known else 0.0)
    initial = state.PageState(
        strikes=given.strikes,
        max_presence_age=given.max_presence_age,
        engines=Engines(since_when=OLDER if epoch.is_past else NOT_YET),
    )
    newest = BehaviorSubject(initial)

    # What pages do: they open, hold the switch, and ask for something
    events: Subject[server.Event] = Subject()
    is_open = pages_are_open(events, node.scheduler).share()
    set_elsewhere = during(is_open, parameter_changes(node)).share()
    hands = only(events, hold.Press, hold.Beat, hold.Release)
    switch = Switch(node, hands, set_elsewhere, is_open, clock.now)
    asked = only(events, server.Request).share()
    commands = requests.engine_commands(asked).share()
    node.publish(topics.ENGINES, commands.map(lambda command: command.value))
    turn_offs = commands.filter(lambda command: command.value == TURN_OFF).share()
    own_turn_offs = turn_offs.map(lambda command: (command.timestamp, stamps.now()))  # it is published by now
    configuration = requests.Configuration(node)
    signals = asked.filter(lambda it: isinstance(it.message, protocol.Process))

    # What is observed, with one reader of each topic for state and lines
    observed = {topic.name: node.observe(topic, timestamped=True).share() for topic in topics.CONTRACT}

    def seen(topic: topics.Topic) -> Observable[Any]:
        return observed[topic.name]

    unseen = node.observe_sampled(UNSEEN, UNSEEN_PERIOD, timestamped=True)
    engines = is_open.start_with(False).switch_map(lambda it: seen(topics.ENGINES_STATE) if it else unseen)
    ticks = rx.interval(LINES_PERIOD, node.scheduler)
    present = graph(node)
    lines = line_batches(seen, own_turn_offs, ticks, present, node.get_namespace())

    # What pages show
    changes = rx.merge(
        state.always(seen, engines, new_watchdogs(node, epoch), present, clock),
        during(is_open, state.while_open(seen, lines, node.get_namespace(), clock)),
        switch.holds.map(state.held),
        switch.pressed.map(state.pressed),
        during(is_open, terminal_holds(node)).map(state.held_at_terminal),
        during(is_open, loopback(node)).map(state.connected),
        turn_offs.map(lambda _: state.turned_off(clock.now())),
        configuration.followers(set_elsewhere, is_open),
        configuration.outcomes(asked),
        signals.flat_map(lambda it: requests.send_signal(it, newest.value.programs)),
    )
    # A scheduler would subscribe to one part of the recipe after another, and the first page may be faster.
    state.page_states(changes, initial).subscribe(newest.on_next, node.fail)
    node.publish(topics.OPERATOR_HEARTBEAT, hold.heartbeats(switch.holds))
    only(events, server.Violation).subscribe(lambda it: node.health.drop("page", it.reason))

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


def new_watchdogs(node: ServiceNode, epoch: Epoch) -> Observable[bool]:
    """Emit for each operator watchdog that appears whether it is new; the first may be older than us."""
    topic = topics.OPERATOR_ACTIVITY
    matches = node.create_event_observable(topic.type, topic.name, topic.qos, "matched")
    appeared = matches.filter(lambda it: it.current_count_change > 0)
    return appeared.map_indexed(lambda _, index: index > 0 or not epoch.is_past)


def terminal_holds(node: ServiceNode) -> Observable[bool]:
    """Emit whether a hand at a terminal sends heartbeats: it has a publisher then."""
    name = node.resolve_topic_name(topics.OPERATOR_HEARTBEAT.name)
    services = (VIRTUAL_SWITCH, manifest.PAGE)

    def look(_: Any) -> bool:
        return any(each.node_name not in services for each in node.get_publishers_info_by_topic(name))

    return rx.timer(0.0, TERMINALS_PERIOD, node.scheduler).map(look).distinct_until_changed()


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
    names = address.host_names(parameters.address, port, parameters.names.split())
    scheme = "https" if tls else "http"
    pages = server.PageServer(
        listener,
        Site(token, names, scheme),
        welcome=welcome(given),
        receive=receive,
        newest=newest,
        clock=clock,
        fail=node.fail,
        tls=tls,
    )
    node.context.on_shutdown(pages.close)
    note(node, file, f"The page: {scheme}://{names[0]}/#{token}")


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
        "off_within": of_this_arm.off_within,
        "beat": server.UPDATE_PERIOD,
        "max_nonce_age": hold.MAX_NONCE_AGE,
    }


if __name__ == "__main__":
    service.run(manifest.PAGE, wire)
