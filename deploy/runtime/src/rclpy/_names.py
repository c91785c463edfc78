"""Converts names between ROS and DDS (ROS 2 design article "Topic and Service name mapping to DDS")."""

from __future__ import annotations

TOPIC_PREFIX, REQUEST_PREFIX, REPLY_PREFIX = "rt", "rq", "rr"


def topic_to_dds(name: str, *, avoid_conventions: bool = False) -> str:
    """``/effector/speed`` → ``rt/effector/speed``."""
    return name if avoid_conventions else TOPIC_PREFIX + name


def request_to_dds(service: str) -> str:
    """``/turn_on`` → ``rq/turn_onRequest``."""
    return f"{REQUEST_PREFIX}{service}Request"


def reply_to_dds(service: str) -> str:
    """``/turn_on`` → ``rr/turn_onReply``."""
    return f"{REPLY_PREFIX}{service}Reply"


def topic_from_dds(name: str) -> str | None:
    """``rt/effector/speed`` → ``/effector/speed``; ``None`` if it is not a ROS topic."""
    return name[len(TOPIC_PREFIX) :] if name.startswith(TOPIC_PREFIX + "/") else None


def service_from_dds(name: str) -> str | None:
    """``rq/turn_onRequest`` or ``rr/turn_onReply`` → ``/turn_on``; ``None`` if it is not a ROS service."""
    for prefix, suffix in ((REQUEST_PREFIX, "Request"), (REPLY_PREFIX, "Reply")):
        if name.startswith(prefix + "/") and name.endswith(suffix):
            return name[len(prefix) : -len(suffix)]
    return None


def type_from_dds(name: str) -> str:
    """``std_msgs::msg::dds_::Float64_`` → ``std_msgs/msg/Float64``; other names are unchanged."""
    if "::dds_::" not in name or not name.endswith("_"):
        return name
    return name[:-1].replace("::dds_::", "::").replace("::", "/")


def service_type_from_dds(name: str) -> str:
    """``std_srvs::srv::dds_::Trigger_Request_`` → ``std_srvs/srv/Trigger``; other names are unchanged."""
    ros_type = type_from_dds(name)
    for suffix in ("_Request", "_Response"):
        ros_type = ros_type.removesuffix(suffix)
    return ros_type
