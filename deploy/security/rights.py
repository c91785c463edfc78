"""The rights of each process of an arm in DDS: those of its enclave follow from the contract.

Names are those of DDS (``rt/engines``). ``*`` stands for any characters, ``/`` included.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import NamedTuple

from deploy.supervision import manifest
from interfaces import topics
from interfaces.service.enclave import path

TERMINAL = "terminal"
"""The enclave of `make run`, `start`, `terminal` and `status`."""
RECORDER = "recorder"
"""The enclave of `make record`."""
TOOLS = "tools"
"""The enclave for `ros2`, RViz and Foxglove."""
GRAPH = "ros_discovery_info"
"""The topic on which each process announces its nodes."""
_READ_PARAMETERS = (
    "describe_parameters",
    "get_parameter_types",
    "get_parameters",
    "get_type_description",
    "list_parameters",
)
_SERVICES = (*_READ_PARAMETERS, "set_parameters", "set_parameters_atomically")  # of each node
_OF_OWN_PROGRAMS = (topics.TF, topics.DIAGNOSTICS, *topics.CONFIGURATION.values())
"""What a program of the user's own may publish: what robots share, and the configuration."""


class Rule(NamedTuple):
    """The DDS topics that may be used, or must not be used."""

    publish: frozenset[str]
    subscribe: frozenset[str]
    allows: bool = True


Rights = tuple[Rule, ...]
"""The first rule that names a topic counts; all others are denied."""


def of_arm(namespace: str, programs: Collection[str]) -> dict[str, Rights]:
    """Return the rights by enclave: one for each program, and those of terminal, recorder, tools and fleet.

    :param programs: the names of ours, and of the user's own.
    """
    ours = {program.name for program in manifest.programs(manifest.PATH)}
    rights: dict[str, Rights] = {}
    for name in programs:
        if name in ours or name in manifest.sentinels():
            rights[name] = _service(namespace, name, programs)
        else:
            rights[name] = _guest([each for each in programs if each != name], _OF_OWN_PROGRAMS)
    rights[TERMINAL] = _terminal(namespace, programs)
    rights[RECORDER] = observer(namespace, RECORDER)
    rights[TOOLS] = _guest(programs, [topics.TF])
    return {path(name, namespace): each for name, each in rights.items()} | {
        path(topics.FLEET, "/"): _fleet()
    }


def observer(namespace: str, name: str) -> Rights:
    """Return the rights to read the contract, and to publish nothing of it; its nodes are NAME_*."""
    return _node(namespace, f"{name}_*", (), topics.ROWS)


def babbler(namespace: str, name: str) -> Rights:
    """Return the rights of a bad program that may write to each topic: for tests."""
    return _node(namespace, f"{name}_*", topics.ROWS, ())


def _service(namespace: str, name: str, programs: Iterable[str]) -> Rights:
    """A service of ours does what the contract says of its node."""
    node = manifest.SENTINEL if name in manifest.sentinels() else name
    published = [topic for topic in topics.ROWS if {node, topics.EVERY_SERVICE} & {*topic.publishers}]
    read = [topic for topic in topics.ROWS if node in topic.subscribers]
    return _node(namespace, name, published, read, _servers(name, programs))


def _terminal(namespace: str, programs: Iterable[str]) -> Rights:
    """The terminal is no service, so it reports no health; its nodes are terminal_*, and those of `ros2`."""
    published = [topic for topic in topics.ROWS if TERMINAL in topic.publishers]
    read = [topic for topic in topics.ROWS if TERMINAL in topic.subscribers]
    rights = _node(namespace, f"{TERMINAL}_*", published, read, _servers(TERMINAL, programs))
    return rights + _node("", "_ros2cli*", (), ())


def _fleet() -> Rights:
    """The fleet watches all arms of a keystore, in each namespace; its nodes are fleet_*."""
    (rule,) = _node("", f"{topics.FLEET}_*", (), ())
    shown = _topics("*", (topic for topic in topics.ROWS if topics.FLEET in topic.subscribers))
    return (rule._replace(subscribe=rule.subscribe | shown),)


def _servers(name: str, programs: Iterable[str]) -> Iterable[str]:
    servers = topics.PARAMETER_CLIENTS.get(name, ())
    return programs if topics.EVERY_SERVICE in servers else servers


def _node(
    namespace: str,
    name: str,
    published: Iterable[topics.Topic],
    read: Iterable[topics.Topic],
    servers: Iterable[str] = (),
) -> Rights:
    """What each node of ROS 2 needs, these topics, and the parameters of the servers."""
    own, others = _services(namespace, [name]), _services(namespace, servers)
    publish = {"rt/rosout", "rt/parameter_events"}
    publish |= _topics(namespace, published) | _replies(own) | _requests(others)
    subscribe = {"rt/clock", "rt/parameter_events"}
    subscribe |= _topics(namespace, read) | _requests(own) | _replies(others)
    return (Rule(frozenset(publish), frozenset(subscribe)),)


def _guest(programs: Iterable[str], free: Collection[topics.Topic]) -> Rights:
    """A guest reads all topics and parameters, and uses all topics and services that are no arm's.

    :param programs: those for which it must not answer, and whose parameters it must not set.
    :param free: the topics of the arm that it may publish.
    """
    names = {topic.name for topic in free}
    # In each namespace: the keystore may be that of several arms.
    closed = _topics("*", (topic for topic in topics.ROWS if topic.name not in names))
    nodes = {path(program, "*") for program in programs}
    asked = {f"rq{node}/*" for node in nodes}
    # What may be used one way comes first: Cyclone DDS opens no topic that is denied one way before it.
    return (
        Rule(frozenset(f"rq*/{service}Request" for service in _READ_PARAMETERS), frozenset({"rt/*", "rr/*"})),
        Rule(frozenset(closed | asked | {f"rr{node}/*" for node in nodes}), frozenset(asked), allows=False),
        Rule(frozenset({"rt/*", "rq/*", "rr/*"}), frozenset({"rq/*"})),
    )


def _topics(namespace: str, rows: Iterable[topics.Topic]) -> set[str]:
    return {f"rt{topic.full_name(namespace)}" for topic in rows}


def _services(namespace: str, nodes: Iterable[str]) -> list[str]:
    return [path(f"{node}/{service}", namespace) for node in nodes for service in _SERVICES]


def _requests(services: Iterable[str]) -> set[str]:
    return {f"rq{service}Request" for service in services}


def _replies(services: Iterable[str]) -> set[str]:
    return {f"rr{service}Reply" for service in services}
