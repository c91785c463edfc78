"""The seam: which names of rclpy's C extension are its own, and which are the substitute's.

``python -m rclpy_ground.seam`` prints the table of SEAM.md.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from rclpy_ground.genuine import NAME, PATH, genuine

OURS = (
    "actions.ActionClient",
    "actions.ActionServer",
    "clocks.Clock",
    "clocks.ClockEvent",
    "contexts.Context",
    "events.EventHandle",
    "events.rmw_incompatible_type_status_t",
    "events.rmw_liveliness_changed_status_t",
    "events.rmw_liveliness_lost_status_t",
    "events.rmw_matched_status_t",
    "events.rmw_message_lost_status_t",
    "events.rmw_offered_deadline_missed_status_t",
    "events.rmw_requested_deadline_missed_status_t",
    "events.rmw_requested_qos_incompatible_event_status_t",
    "events_executor.EventsExecutor",
    "goals.ActionGoalHandle",
    "graph.rclpy_get_client_names_and_types_by_node",
    "graph.rclpy_get_publisher_names_and_types_by_node",
    "graph.rclpy_get_publishers_info_by_topic",
    "graph.rclpy_get_service_names_and_types",
    "graph.rclpy_get_service_names_and_types_by_node",
    "graph.rclpy_get_subscriber_names_and_types_by_node",
    "graph.rclpy_get_subscriptions_info_by_topic",
    "graph.rclpy_get_topic_names_and_types",
    "handles.Destroyable",
    "lifecycle.LifecycleStateMachine",
    "messages.rclpy_serialize",
    "rosout.Node",
    "nodes.rclpy_get_rmw_implementation_identifier",
    "nodes.rclpy_remap_topic_name",
    "nodes.rclpy_resolve_name",
    "services.Client",
    "services.Service",
    "services.TypeDescriptionService",
    "services.rmw_request_id_t",
    "services.rmw_service_info_t",
    "signals.get_current_signal_handlers_options",
    "signals.install_signal_handlers",
    "signals.register_sigint_guard_condition",
    "signals.uninstall_signal_handlers",
    "signals.unregister_sigint_guard_condition",
    "timers.Timer",
    "topics.Publisher",
    "topics.Subscription",
    "topics.rclpy_assert_liveliness",
    "waiting.GuardCondition",
    "waiting.WaitSet",
)
"""What communicates or waits: modules of this package, and the names there."""
LOGS = (
    "rclpy_logging_configure",
    "rclpy_logging_fini",
    "rclpy_logging_get_logger_effective_level",
    "rclpy_logging_get_logger_level",
    "rclpy_logging_initialize",
    "rclpy_logging_logger_is_enabled_for",
    "rclpy_logging_rcutils_log",
    "rclpy_logging_rosout_add_sublogger",
    "rclpy_logging_rosout_remove_sublogger",
    "rclpy_logging_set_logger_level",
    "rclpy_logging_shutdown",
)
"""Logging: ours where processes share the interpreter."""
LOGS_OF_ONE_PROCESS = (
    "rclpy_logging_configure",
    "rclpy_logging_rcutils_log",
    "rclpy_logging_rosout_add_sublogger",
    "rclpy_logging_rosout_remove_sublogger",
)
"""What is ours of it where the interpreter is one process: what needs the context or ``/rosout``."""
GENUINE = (
    "ClockChange",
    "ClockType",
    "GoalEvent",
    "InvalidHandle",
    "NodeNameNonExistentError",
    "NotImplementedError",
    "QoSCheckCompatibleResult",
    "QoSCompatibility",
    "RCLError",
    "RCLInvalidROSArgsError",
    "RCL_DEFAULT_DOMAIN_ID",
    "RCUTILS_LOG_SEVERITY",
    "RCUtilsError",
    "RMWError",
    "RMW_DURATION_INFINITE",
    "RMW_QOS_DEADLINE_BEST_AVAILABLE",
    "RMW_QOS_LIVELINESS_LEASE_DURATION_BEST_AVAILABLE",
    "SignalHandlerOptions",
    "TimerCancelledError",  # since Kilted
    "TransitionCallbackReturnType",
    "UnknownROSArgsError",
    "UnsupportedEventTypeError",
    "rcl_duration_t",
    "rcl_publisher_event_type_t",
    "rcl_subscription_event_type_t",
    "rcl_time_point_t",
    "rclpy_action_get_rmw_qos_profile",
    "rclpy_deserialize",
    "rclpy_expand_topic_name",
    "rclpy_get_validation_error_for_full_topic_name",
    "rclpy_get_validation_error_for_namespace",
    "rclpy_get_validation_error_for_node_name",
    "rclpy_get_validation_error_for_topic_name",
    "rclpy_logging_get_logging_directory",
    "rclpy_logging_get_separator_string",
    "rclpy_logging_severity_level_from_string",
    "rclpy_qos_check_compatible",
    "rclpy_remove_ros_args",
    "rmw_qos_policy_kind_t",
    "rmw_qos_profile_t",
    "service_introspection",
)
"""What neither communicates nor waits."""


def exported() -> list[str]:
    """Return the names of the installed extension."""
    return [name for name in dir(genuine) if not name.startswith("__")]


def check() -> None:
    """Raise ImportError if the extension has names that this substitute does not know."""
    known = {*GENUINE, *LOGS, *(path.partition(".")[2] for path in OURS)}
    if unknown := [name for name in exported() if name not in known]:
        raise ImportError(
            f"rclpy_ground knows Jazzy and Kilted, but not these names of {PATH}: {', '.join(unknown)}"
        )


def module(*, own_logs: bool) -> ModuleType:
    """Return what stands in the place of the extension."""
    found = ModuleType(f"rclpy.{NAME}", "The substitute of rclpy_ground.")
    for name in exported():
        setattr(found, name, getattr(genuine, name))
    logs = [f"logs.{name}" for name in LOGS]
    if not own_logs:
        logs = [f"genuine_logs.{name}" for name in LOGS_OF_ONE_PROCESS]
    for path in (*OURS, *logs):
        place, _, name = path.partition(".")
        setattr(found, name, getattr(import_module(f"{__package__}.{place}"), name))
    return found


def table() -> str:
    """Return the seam as a Markdown table, with the names of all releases."""
    whose = dict.fromkeys(GENUINE, "genuine") | dict.fromkeys(LOGS, "ours: `logs`")
    for path in OURS:
        place, _, name = path.partition(".")
        whose[name] = f"ours: `{place}`"
    return "\n".join(
        ["| name | whose |", "|---|---|", *(f"| `{each}` | {whose[each]} |" for each in sorted(whose))]
    )


if __name__ == "__main__":
    print(table())
