"""What a subclass of Node may call its own is the same as with rclpy's Node."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node

# All that Node of rclpy 7.1.3 (rclpy/node.py) has, with the names that Python makes of those in `__`.
RCLPYS_PRIVATE_NAMES = {
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


def test_private_names_that_rclpys_node_does_not_have_are_left_to_users(
    make_node: Callable[..., Node],
) -> None:
    node = make_node(enable_logger_service=True)
    private = {name for name in {*dir(node), *vars(node)} if name.startswith("_")}
    own = {name for name in private if not name.startswith(("__", "_rclpy_"))}
    assert own <= RCLPYS_PRIVATE_NAMES
