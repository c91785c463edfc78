"""Checks that a class is a message or service type."""

from __future__ import annotations

from typing import Any


def check_for_type_support(msg_or_srv_type: Any) -> None:
    """Raise AttributeError if a class is not a message, service or action type of this runtime."""
    if not hasattr(msg_or_srv_type, "_TYPE_NAME"):
        if hasattr(msg_or_srv_type.__class__, "_TYPE_SUPPORT"):
            raise AttributeError(
                f"{msg_or_srv_type!r} was generated for ROS 2's own rclpy: this rclpy needs the definitions"
                " of its package in AMENT_PREFIX_PATH, and no generated package of that name in sys.path"
            )
        raise AttributeError(f"{msg_or_srv_type!r} is not a ROS 2 message or service type")


def check_is_valid_msg_type(msg_type: Any) -> None:
    """Raise RuntimeError for another type of ROS than a message, AttributeError for other classes."""
    check_for_type_support(msg_type)
    if not hasattr(msg_type, "_serialize"):
        raise RuntimeError(
            f"The message type provided is not valid ({msg_type}), this might be a service or action"
        )


def check_is_valid_srv_type(srv_type: Any) -> None:
    """Raise RuntimeError for another type of ROS than a service, AttributeError for other classes."""
    check_for_type_support(srv_type)
    if not hasattr(srv_type, "Request"):
        raise RuntimeError(
            f"The service type provided is not valid ({srv_type}), this might be a message or action"
        )
