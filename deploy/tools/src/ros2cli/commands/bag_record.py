"""`ros2 bag record`."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ros2cli import graph, rosbag2
from ros2cli.options import (
    POSITIVE_INT,
    ManyValues,
    VerbWithManyValues,
    qos_overrides_option,
    regular_expression,
    storage_option,
)

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.qos import QoSProfile
    from ros2cli.bag_writer import BagWriter

_DEPTH = 1000
"""Messages of a topic that may wait to be written."""


@click.command(cls=VerbWithManyValues)
@click.argument("topics_positional", nargs=-1, metavar="[TOPIC]...")
@click.option(
    "-o", "--output", help="Bag to create. By default, a timestamped folder in the current directory."
)
@storage_option
@click.option("--topics", cls=ManyValues, metavar="TOPIC...", help="Topics to record.")
@click.option("--topic-types", cls=ManyValues, metavar="TYPE...", help="Topic types to record.")
@click.option("-a", "--all", "everything", is_flag=True, help="Record all topics (exclude hidden topics).")
@click.option("--all-topics", is_flag=True, help="Record all topics (exclude hidden topics).")
@click.option(
    "-e", "--regex", callback=regular_expression, help="Record topics that contain this expression."
)
@click.option(
    "--exclude-regex", callback=regular_expression, help="Exclude topics that contain this expression."
)
@click.option("--exclude-topics", cls=ManyValues, metavar="TOPIC...", help="Topics not to record.")
@click.option("--exclude-topic-types", cls=ManyValues, metavar="TYPE...", help="Topic types not to record.")
@click.option("--include-unpublished-topics", is_flag=True, help="Record topics which have no publisher.")
@click.option("--include-hidden-topics", is_flag=True, help="Record hidden topics as well.")
@click.option("--no-discovery", is_flag=True, help="Record only topics that are present at startup.")
@click.option(
    "-p",
    "--polling-interval",
    type=POSITIVE_INT,
    default=100,
    show_default=True,
    help="Time in ms to wait between querying available topics.",
)
@click.option("--ignore-leaf-topics", is_flag=True, help="Ignore topics without a subscription.")
@qos_overrides_option
@click.option("--use-sim-time", is_flag=True, help="Use simulation time for message timestamps.")
@click.option("--node-name", default="rosbag2_recorder", show_default=True, help="The recorder's node name.")
@click.option("--custom-data", cls=ManyValues, metavar="KEY=VALUE...", help="Data to store in the metadata.")
@click.option(
    "--storage-preset-profile",
    type=click.Choice(["none", "fastwrite", "zstd_fast", "zstd_small"]),
    default="none",
    show_default=True,
    help="How the file is written: without chunks (fastwrite) or with compressed ones (zstd).",
)
def record(
    topics_positional: tuple[str, ...],
    output: str | None,
    node_name: str,
    use_sim_time: bool,
    custom_data: tuple[str, ...],
    storage_preset_profile: str,
    **options: Any,
) -> None:
    """Record ROS data to a bag, until Ctrl-C. New topics are recorded as well."""
    from mcap_files import SAVE_PERIOD
    from rclpy.clock import Clock, ClockType
    from ros2cli.bag_writer import BagWriter

    options["topics"] = options["topics"] or topics_positional
    options["all_topics"] |= options["everything"]
    if not any(options[name] for name in ("all_topics", "topics", "topic_types", "regex")):
        raise _error(
            "Need to specify at least one option out of"
            " --all, --all-topics, --topics, --topic-types or --regex"
        )
    for name in ("exclude_regex", "exclude_topics", "exclude_topic_types"):
        if options[name] and not any(options[by] for by in ("all_topics", "topic_types", "regex")):
            option = name.replace("_", "-")
            raise _error(f"--{option} argument requires either --all, --all-topics, --topic-types or --regex")
    bag = Path(output or time.strftime("rosbag2_%Y_%m_%d-%H_%M_%S"))
    if bag.exists():
        raise _error(f"Output folder '{bag}' already exists.")
    pairs = [pair.partition("=") for pair in custom_data]
    overrides = rosbag2.qos_overrides(options["qos_profile_overrides_path"])
    with graph.node(name=node_name, use_sim_time=use_sim_time) as node:
        try:
            writer = BagWriter(bag, storage_preset_profile, {key: value for key, _, value in pairs})
        except OSError as error:
            raise _error(f"Could not create bag folder '{bag}': {error.strerror}") from None
        try:
            recorder = _Recorder(node, writer, _Selection(node, options), overrides, use_sim_time)
            node.get_logger().info("Listening for topics...")
            if options["no_discovery"]:
                graph.discover(node, graph.default_spin_time())
                recorder.subscribe()
            else:
                node.create_timer(options["polling_interval"] / 1000.0, recorder.subscribe)
            node.create_timer(SAVE_PERIOD, writer.save, clock=Clock(clock_type=ClockType.STEADY_TIME))
            node.get_logger().info("Recording...")
            _spin(node, writer)
        except OSError as error:
            raise _error(f"{error.filename}: {error.strerror}") from None
        finally:
            node.get_logger().info("Recording stopped")


def _spin(node: Node, writer: BagWriter) -> None:
    """Record until Ctrl-C or SIGTERM. Raises OSError, for example of a full disk."""
    try:
        graph.spin(node)
    except (KeyboardInterrupt, SystemExit):
        pass
    finally:
        writer.close()


def _error(text: str) -> click.ClickException:
    return click.ClickException(f"[ERROR] [ros2bag]: {text}")


class _Recorder:
    def __init__(
        self,
        node: Node,
        writer: BagWriter,
        selection: _Selection,
        overrides: dict[str, QoSProfile],
        use_sim_time: bool,
    ) -> None:
        self._node = node
        self._writer = writer
        self._selection = selection
        self._overrides = overrides
        self._use_sim_time = use_sim_time
        self._known: set[str] = set()

    def subscribe(self) -> None:
        for name, type_ in self._selection.topics().items():
            if name not in self._known:
                self._known.add(name)
                self._subscribe(name, type_)

    def _subscribe(self, name: str, type_: str) -> None:
        log = self._node.get_logger()
        try:
            class_ = graph.interface_class("message", type_, "")
        except RuntimeError:
            log.warn(f"Topic '{name}' has unknown type '{type_}'. Only topics with known type are supported.")
            return
        offers = self._node.get_publishers_info_by_topic(name)
        hashes = {str(offer.topic_type_hash) for offer in offers}
        topic = rosbag2.Topic(name, type_, [offer.qos_profile for offer in offers])
        topic.type_hash = hashes.pop() if len(hashes) == 1 else ""
        write = self._writer.add_topic(topic)
        clock = self._node.get_clock()

        def receive(data: bytes, info: dict[str, Any]) -> None:
            received = clock.now().nanoseconds if self._use_sim_time else info["received_timestamp"]
            write(data, received, info["source_timestamp"])

        profile = self._overrides.get(name) or _matching(topic)
        self._node.create_subscription(class_, name, receive, profile, raw=True)
        log.info(f"Subscribed to topic '{name}'")


def _matching(topic: rosbag2.Topic) -> QoSProfile:
    """The QoS that matches all publishers that are known, and is otherwise as strong as theirs."""
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    reliable = all(offer.reliability == ReliabilityPolicy.RELIABLE for offer in topic.offered)
    latched = bool(topic.offered) and all(
        offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in topic.offered
    )
    return QoSProfile(
        depth=_DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


class _Selection:
    """The topics that the options select, in the order in which rosbag2 applies them."""

    def __init__(self, node: Node, options: dict[str, Any]) -> None:
        self._node = node
        self._options = options
        self._topics = {graph.full_topic_name(node, topic) for topic in options["topics"]}
        self._excluded = {graph.full_topic_name(node, topic) for topic in options["exclude_topics"]}

    def topics(self) -> dict[str, str]:
        """Return the names and types of the topics in the graph that are selected."""
        return {
            name: types[0]
            for name, types in self._node.get_topic_names_and_types()
            if len(types) == 1 and self._is_wanted(name, types[0]) and self._is_in_use(name)
        }

    def _is_wanted(self, name: str, type_: str) -> bool:
        given = self._options
        included = given["all_topics"] or name in self._topics or type_ in given["topic_types"]
        excluded = (
            name in self._excluded
            or type_ in given["exclude_topic_types"]
            or (given["exclude_regex"] and re.search(given["exclude_regex"], name))
            or (not given["include_hidden_topics"] and graph.is_hidden(name))
        )
        return not excluded and bool(included or (given["regex"] and re.search(given["regex"], name)))

    def _is_in_use(self, name: str) -> bool:
        given = self._options
        if not given["include_unpublished_topics"] and not self._node.count_publishers(name):
            return False
        return not given["ignore_leaf_topics"] or self._node.count_subscribers(name) > 0
