"""Node has the private names of rclpy's Node and no others: subclasses may use the rest."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node

# The private names of Node in rclpy 7.1.3 (rclpy/node.py); those with `__` as Python mangles them.
RCLPY_PRIVATE_NAMES = {
    "_Node__executor_weakref",
    "_Node__handle",
    "_Node__node",
    "_Node__waitables",
    "_allow_undeclared_parameters",
    "_apply_descriptor",
    "_apply_descriptor_and_set",
    "_apply_descriptors",
    "_apply_floating_point_range",
    "_apply_integer_range",
    "_call_post_set_parameters_callback",
    "_call_pre_set_parameters_callback",
    "_check_undeclared_parameters",
    "_clients",
    "_clock",
    "_context",
    "_count_clients_or_servers",
    "_count_publishers_or_subscribers",
    "_declare_parameter_common",
    "_default_callback_group",
    "_descriptors",
    "_get_info_by_topic",
    "_guards",
    "_logger",
    "_logger_service",
    "_on_set_parameters_callbacks",
    "_parameter_event_publisher",
    "_parameter_overrides",
    "_parameter_service",
    "_parameters",
    "_post_set_parameters_callbacks",
    "_pre_set_parameters_callbacks",
    "_publishers",
    "_rate_group",
    "_services",
    "_set_parameters_atomically",
    "_set_parameters_atomically_common",
    "_subscriptions",
    "_time_source",
    "_timers",
    "_type_description_service",
    "_validate_qos_or_depth_parameter",
    "_validate_topic_or_service_name",
    "_wake_executor",
}


def test_node_has_no_private_names_beyond_those_of_rclpy(
    make_node: Callable[..., Node],
) -> None:
    node = make_node(enable_logger_service=True)
    private = {name for name in {*dir(node), *vars(node)} if name.startswith("_")}
    own = {name for name in private if not name.startswith(("__", "_rclpy_"))}
    assert own <= RCLPY_PRIVATE_NAMES
