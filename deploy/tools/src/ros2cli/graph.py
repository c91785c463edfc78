"""The node of a command, and what it finds in the graph."""

from __future__ import annotations

import concurrent.futures
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import click

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.task import Future
    from rclpy.topic_endpoint_info import TopicEndpointInfo

NODE_NAME_PREFIX = "_ros2cli"
_PERIOD = 0.02
"""Period at which the graph is looked at [s]."""
_CALM = 0.2
"""The graph is complete if nothing appeared for this long [s]."""
_LONGEST = 5.0
"""A graph that never rests is looked at for so much longer than asked for [s]."""


class NodeName(NamedTuple):
    """The name of a node, its namespace, and both."""

    name: str
    namespace: str
    full_name: str


@contextmanager
def node(
    spin_time: float = 0.0,
    *,
    until: Callable[[Node], bool] | None = None,
    name: str | None = None,
    use_sim_time: bool = False,
    arguments: list[str] | None = None,
) -> Iterator[Node]:
    """Create a node, by default a hidden one, and shut everything down at the end.

    :param spin_time: how long it looks for other nodes at first [s].
    :param until: ends this as soon as it is true and nothing more appears.
    :param arguments: ROS arguments of the node.
    """
    import rclpy
    from rclpy.exceptions import NameValidationException
    from rclpy.parameter import Parameter
    from rclpy.signals import SignalHandlerOptions

    # Signals end the command by an exception (cli.py), which finds the node still usable.
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node(
            name or f"{NODE_NAME_PREFIX}_{os.getpid()}",
            cli_args=arguments,
            start_parameter_services=False,
            parameter_overrides=[Parameter("use_sim_time", value=use_sim_time)],
        )
        discover(node, spin_time, until)
        yield node
    except NameValidationException as error:
        raise click.ClickException(
            str(error).rpartition("\n")[0]
        ) from None  # without the mark below the name
    except UnicodeDecodeError as error:
        raise click.ClickException(
            f"The name {error.object!r} on this graph is not UTF-8: rclpy shows no other until it ends"
        ) from None
    finally:
        rclpy.try_shutdown()


def default_spin_time() -> float:
    """How long a node looks for others at first, unless the user says otherwise [s].

    A new participant of Fast DDS announces itself before it listens. It may miss the answer of a peer, which
    answers only once, and hears of it with the peer's next announcement: by default within 3 s. With
    security, participants first check each other's keys.
    """
    import rclpy

    is_secure = os.environ.get("ROS_SECURITY_ENABLE") == "true"
    return 3.2 if is_secure or "fastrtps" in rclpy.get_rmw_implementation_identifier() else 0.5


def publishers(node: Node, topic: str) -> list[TopicEndpointInfo]:
    """Return the publishers of a topic; none while rclpy cannot read the name of a node."""
    try:
        found: list[TopicEndpointInfo] = node.get_publishers_info_by_topic(topic)
    except UnicodeDecodeError:
        return []
    return found


def _size(node: Node) -> tuple[int, int]:
    """Return how many nodes and topics there are; 0 while rclpy cannot read the name of one."""
    sizes = []
    for names in (node.get_node_names, lambda: node.get_topic_names_and_types(no_demangle=True)):
        try:
            sizes.append(len(names()))
        except UnicodeDecodeError:
            sizes.append(0)
    nodes, topics = sizes
    return nodes, topics


def discover(node: Node, spin_time: float, until: Callable[[Node], bool] | None = None) -> None:
    """Look for ``spin_time`` [s], and longer while more nodes and topics appear; ``until`` as in `node`."""
    began = time.monotonic()
    changed, known = began, (0, 0)
    while (now := time.monotonic()) < began + spin_time or (
        spin_time > 0 and now < min(changed + _CALM, began + spin_time + _LONGEST)
    ):
        time.sleep(min(_PERIOD, spin_time))
        found = _size(node)
        if found != known:
            changed, known = time.monotonic(), found
        elif until and until(node) and time.monotonic() >= changed + _CALM:
            return


def is_published(topic: str) -> Callable[[Node], bool]:
    """Return the condition that a topic has a publisher. It raises RuntimeError if the name is invalid."""
    return lambda node: node.count_publishers(full_topic_name(node, topic)) > 0


def wait_for(condition: Callable[[], bool], timeout: float) -> bool:
    """Wait until ``condition`` is true, at most ``timeout`` [s]; negative: forever. Return whether it is."""
    deadline = time.monotonic() + timeout
    while not condition():
        if timeout >= 0 and deadline < time.monotonic():
            return False
        time.sleep(_PERIOD)
    return True


def is_hidden(name: str) -> bool:
    """Whether a part of the name of a topic, service or action begins with an underscore."""
    from rclpy.topic_or_service_is_hidden import topic_or_service_is_hidden

    return topic_or_service_is_hidden(name)


def topics(node: Node, *, include_hidden: bool) -> list[tuple[str, list[str]]]:
    """Return the topics that have a publisher or subscription, each with its types."""
    return [it for it in node.get_topic_names_and_types() if include_hidden or not is_hidden(it[0])]


def message_class(node: Node, topic: str, *, blocking: bool = False) -> Any | None:
    """Return the class of a topic's messages; print a warning if nobody publishes or subscribes to it yet.

    :param blocking: wait for the topic; otherwise return ``None``.
    :raises RuntimeError: if the name is invalid, or the type is unknown or not the only one.
    """
    name = full_topic_name(node, topic)
    types = dict(node.get_topic_names_and_types()).get(name)
    if types is None:
        print(f"WARNING: topic [{topic}] does not appear to be published yet")
    while types is None:
        if not blocking:
            return None
        time.sleep(_PERIOD)
        types = dict(node.get_topic_names_and_types()).get(name)
    if len(types) > 1:
        raise RuntimeError(
            f"Cannot echo topic '{topic}', as it contains more than one type: [{', '.join(types)}]"
        )
    return interface_class("message", types[0], f"The message type '{types[0]}' is invalid")


def node_names(node: Node, *, include_hidden: bool) -> list[NodeName]:
    """Return the names of the nodes in the graph."""
    found = [
        NodeName(name, namespace, f"{namespace.rstrip('/')}/{name}")
        for name, namespace in node.get_node_names_and_namespaces()
    ]
    return [one for one in found if include_hidden or not one.name.startswith("_")]


def full_topic_name(node: Node, topic: str) -> str:
    """Return the full name of a topic or action. Raises RuntimeError if it is invalid."""
    from rclpy.exceptions import InvalidTopicNameException
    from rclpy.expand_topic_name import expand_topic_name
    from rclpy.validate_full_topic_name import validate_full_topic_name

    try:
        name = expand_topic_name(topic, node.get_name(), node.get_namespace())
        validate_full_topic_name(name)
    except (ValueError, InvalidTopicNameException) as error:
        raise RuntimeError(error) from None
    return name


def interface_class(kind: str, name: str, problem: str) -> Any:
    """Return the class of a message, service or action; RuntimeError with `problem` if there is none."""
    from rosidl_runtime_py import utilities

    try:
        return getattr(utilities, f"get_{kind}")(name)
    except (AttributeError, ModuleNotFoundError, TypeError, ValueError):  # TypeError: "/std_msgs/String"
        raise RuntimeError(problem) from None


def spin(node: Node, until: Future | None = None, timeout: float | None = None) -> None:
    """Run the callbacks of a node until a future is done, or for a time [s], or forever."""
    with spinning(node, until, timeout) as ending:
        ending.result()


@contextmanager
def spinning(
    node: Node, until: Future | None = None, timeout: float | None = None
) -> Iterator[concurrent.futures.Future[None]]:
    """Run the callbacks of a node in a thread until the scope is left; arguments as of `spin`.

    In the main thread, a signal would interrupt rclpy anywhere, even between two steps that belong together,
    or it would have to wait while rclpy waits in C.

    :return: the end of the thread, with the error of a callback.
    """
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.task import Future

    end = Future()
    if until:
        until.add_done_callback(end.set_result)
    # The thread ends first: rclpy would wait forever if it were shut down just before it begins to wait.
    with SingleThreadedExecutor() as executor, concurrent.futures.ThreadPoolExecutor(1) as threads:
        executor.add_node(node)
        try:
            yield threads.submit(executor.spin_until_future_complete, end, timeout)
        finally:
            end.set_result(None)
