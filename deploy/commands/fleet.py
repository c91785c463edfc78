"""`make fleet`: one process watches many arms, and shows a line for each.

It shows the arms of this host that run now, and those that the user names for other hosts: `/arm1` in the
ROS domain of this shell, `/arm1=5` in domain 5. It runs on Cyclone DDS, which sees arms of both, or on
a sourced ROS 2. With SECURE=yes, it shows the arms that have keys, by the enclave /fleet of their
keystores, else those without.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import ExitStack, contextmanager
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import rclpy
import reactivex as rx
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_rmw_implementation_identifier
from reactivex import Observable

from deploy.operator.fleet import HEADER, Arm, Seen, fleet, row, watched
from deploy.operator.output import Area, say, use_plain_output
from deploy.security.keystore import Keystore
from deploy.supervision import interruption, processes
from deploy.supervision.columns import table
from deploy.supervision.environment import (
    CYCLONEDDS,
    KEYSTORE,
    NAMESPACE,
    RANGE,
    SECURITY,
    is_secured,
    namespace_of,
    set_middleware,
    tagged,
)
from deploy.supervision.errors import DeploymentError
from interfaces.service import UserError, enclave, middleware
from interfaces.service.reading import reading, unreported
from interfaces.topics import DIAGNOSTICS, ENGINES_STATE, FLEET, Topic
from reactive_node import ReactiveNode

PERIOD = 1.0  # s between two looks at the engines, and between two tables
FIRST = 2.5  # s until the first table: each service reports its health once a second
MOST_ENDED = 20  # arms that a table still shows
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
DDS = (RANGE, "ROS_STATIC_PEERS", CYCLONEDDS, SECURITY, KEYSTORE)
"""The variables by which this process meets the nodes of an arm."""


class Domain(NamedTuple):
    """A ROS domain, as the nodes of some arms join it."""

    number: int
    variables: tuple[tuple[str, str], ...]
    """Those of :data:`DDS`."""


class Place(NamedTuple):
    """Where an arm is heard."""

    namespace: str
    domain: Domain


def _is_cyclone() -> bool:
    """Whether this process obeys the settings of Cyclone DDS: a sourced ROS 2 may have another DDS."""
    return get_rmw_implementation_identifier() == "rmw_cyclonedds_cpp"


def place(environment: Mapping[str, str]) -> Place:
    """Return the place of the arm with this environment."""
    known = [name for name in DDS if name != CYCLONEDDS or _is_cyclone()]
    variables = tuple((name, environment[name]) for name in known if environment.get(name))
    return Place(namespace_of(environment), Domain(int(environment.get("ROS_DOMAIN_ID") or 0), variables))


def places(named: Iterable[str]) -> set[Place]:
    """Return where the arms of this host are heard, and those that the user names.

    :raises DeploymentError: if a name is no namespace with a domain.
    """
    return _of_this_host(secured=is_secured(os.environ)).union(*map(_places_of, named))


def _of_this_host(*, secured: bool) -> set[Place]:
    """Return the places of the arms of this host that have keys, or have none."""
    systems = processes.systems().values()
    return {place(environment) for environment in systems if is_secured(environment) == secured}


def hidden_arms() -> str:
    """Name the arms of this host that this command does not show, and the one that does."""
    secured = not is_secured(os.environ)
    names = ", ".join(sorted(each.namespace for each in _of_this_host(secured=secured)))
    how = "with keys: make fleet SECURE=yes" if secured else "without keys: make fleet"
    return f"{names}, {how}" if names else ""


def _places_of(name: str) -> list[Place]:
    """Return where an arm of another host may be heard.

    On Cyclone DDS without keys it has a tag, else none.
    """
    namespace, _, domain = name.partition("=")
    domain = domain or os.environ.get("ROS_DOMAIN_ID") or "0"
    if not namespace.startswith("/") or not domain.isdecimal():
        raise DeploymentError(f"ARMS: {name} is no arm such as /arm1, or /arm1=5 in ROS domain 5")
    environment = {**os.environ, NAMESPACE: namespace, "ROS_DOMAIN_ID": domain}
    may_be_tagged = namespace != "/" and not is_secured(environment)
    tags = ["", tagged(environment)] if may_be_tagged else [""]
    return [place(environment | {CYCLONEDDS: tag}) for tag in tags]


def numbers_of(domains: Iterable[Domain]) -> dict[Domain, int]:
    """Number the domains within this process: Cyclone DDS compares this number with that of the permissions.

    Arms of several tags share a ROS domain: all but the first get a number that is free. Another DDS would
    join the domain of that number.
    """
    ordered = sorted({*domains})
    if not _is_cyclone():
        return {domain: domain.number for domain in ordered}
    free = (number for number in count() if number not in {domain.number for domain in ordered})
    numbers: dict[Domain, int] = {}
    for domain in ordered:
        is_taken = domain.number in numbers.values()
        numbers[domain] = next(free) if is_taken else domain.number
    return numbers


@contextmanager
def joined(domain: Domain, number: int) -> Iterator[ReactiveNode]:
    """Join a domain.

    :param number: of the domain within this process, see :func:`numbers_of`.
    """
    outside = f"<Discovery><ExternalDomainId>{domain.number}</ExternalDomainId></Discovery>"
    settings = dict.fromkeys(DDS, "") | dict(domain.variables)
    uri = [settings[CYCLONEDDS], f"<CycloneDDS><Domain>{outside}</Domain></CycloneDDS>"]
    settings[CYCLONEDDS] = ",".join(filter(None, uri))
    before = dict(os.environ)
    os.environ |= settings
    context = Context()
    try:
        if is_secured(settings):
            Keystore(Path(settings[KEYSTORE])).check([enclave.path(FLEET, "/")], domain.number)
        keys = enclave.arguments(FLEET, "/")
        rclpy.init(
            args=[*middleware.WITHOUT_LOG_FILES, *keys],
            context=context,
            domain_id=number,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        node = ReactiveNode(f"{FLEET}_{os.getpid()}", context=context)
    except (DeploymentError, RuntimeError, UserError) as error:
        raise DeploymentError(f"Cannot join ROS domain {domain.number}: {error}") from None
    finally:
        os.environ.clear()
        os.environ |= before
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)


def join(stack: ExitStack, domains: Iterable[Domain]) -> dict[Domain, ReactiveNode]:
    """Join those domains that let this process join, and print why another does not.

    :raises DeploymentError: if none does.
    """
    nodes, refusals = {}, []
    for domain, number in numbers_of(domains).items():
        try:
            nodes[domain] = stack.enter_context(joined(domain, number))
        except DeploymentError as error:
            refusals.append(error)
    if not nodes:
        raise refusals[-1]
    for refusal in refusals:
        say(str(refusal))
    return nodes


def _observe(node: ReactiveNode, topic: Topic, name: str) -> Observable[Any]:
    options = reading(topic, unreported)  # the services of the arm report the same
    if topic is ENGINES_STATE:  # ten a second are too many to be read
        return node.create_sampled_observable(topic.type, name, PERIOD, BEST_EFFORT, **options)
    return node.create_observable(topic.type, name, topic.qos, **options)


def _seen(namespace: str, nodes: Iterable[ReactiveNode], health: Mapping[ReactiveNode, Any]) -> Seen:
    """Give the topics of an arm as these nodes hear them; all arms of a domain share its /diagnostics."""

    def seen(topic: Topic) -> Observable[Any]:
        name = topic.full_name(namespace)
        return rx.merge(
            *(health[node] if topic is DIAGNOSTICS else _observe(node, topic, name) for node in nodes)
        )

    return seen


def watch(found: Collection[Place], more: Callable[[], bool], area: Area) -> None:
    """Show the arms until there are more of them, or the user ends it."""
    arms = {(namespace, domain.number): Arm(namespace, domain.number) for namespace, domain in sorted(found)}

    def note(arm: Arm) -> None:
        arms[arm.name, arm.domain] = arm

    with ExitStack() as stack:
        nodes = join(stack, (domain for _, domain in found))
        health = {node: _observe(node, DIAGNOSTICS, DIAGNOSTICS.name) for node in nodes.values()}

        def arm_of(key: tuple[str, int]) -> Observable[Arm]:
            heard_by = [nodes[each] for name, each in found if (name, each.number) == key and each in nodes]
            return watched(arms[key], _seen(key[0], heard_by, health), time.monotonic)

        first, *_ = nodes.values()
        executor = stack.enter_context(SingleThreadedExecutor(context=first.context))
        for node in nodes.values():
            executor.add_node(node)
        stack.enter_context(fleet(map(arm_of, [*arms])).subscribe(note, scheduler=first.scheduler))
        due, shown = time.monotonic() + FIRST, ""
        while not more():
            while (now := time.monotonic()) < due:
                interruption.check()
                executor.spin_once(timeout_sec=min(due - now, 0.1))
            due = now + PERIOD
            lines = table([HEADER, *(row(arm, now) for arm in arms.values())])
            if lines != shown:
                area.show(lines)
                shown = lines


def run(named: Sequence[str]) -> None:
    """Watch the arms until the user ends it; arms that ended last stay in the table.

    :raises DeploymentError: for a wrong name, or if there is no arm.
    """
    found: dict[Place, None] = {}
    area = Area()
    if hidden := hidden_arms():
        say(f"Not shown: {hidden}")

    def more() -> bool:
        return not found.keys() >= places(named)

    while found or more():
        running = places(named)
        ended = [each for each in found if each not in running]
        found = dict.fromkeys([*ended[-MOST_ENDED:], *running])
        watch(found, more, area)
    other = " other" if hidden else ""
    raise DeploymentError(f"No{other} arm runs on this host. ARMS=/arm1 names an arm of another host.")


def set_reach(environment: MutableMapping[str, str], named: Collection[str]) -> None:
    """Look for named arms beyond this host, unless the user has set where.

    This concerns no arm of this host: those are met as their own environments say.
    """
    if named and not environment.get("ROS_STATIC_PEERS"):
        environment.setdefault(RANGE, "SUBNET")


def main(arguments: Sequence[str]) -> int:
    """Watch the fleet; return the exit code."""
    interruption.install()
    use_plain_output()
    parser = argparse.ArgumentParser(prog="make fleet", description=__doc__)
    parser.add_argument("arms", nargs="*", metavar="ARM", help="an arm of another host: /arm1, or /arm1=5")
    named = parser.parse_args(arguments).arms
    set_reach(os.environ, named)
    set_middleware(os.environ)
    try:
        run(named)
    except interruption.Interrupted:
        return 0
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except DeploymentError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
