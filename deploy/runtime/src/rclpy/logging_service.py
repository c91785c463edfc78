"""The services to get and set the levels of a process' loggers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rcl_interfaces.msg import LoggerLevel, SetLoggerLevelsResult
from rcl_interfaces.srv import GetLoggerLevels, SetLoggerLevels
from rclpy.logging import get_logger_level, set_logger_level
from rclpy.qos import qos_profile_services_default

if TYPE_CHECKING:
    from rclpy.node import Node


class LoggingService:
    """`<node>/get_logger_levels` and `<node>/set_logger_levels`."""

    def __init__(self, node: Node) -> None:
        """Create the services; they belong to `node`."""
        name = node.get_name()
        node.create_service(
            GetLoggerLevels,
            f"{name}/get_logger_levels",
            _get_logger_levels,
            qos_profile=qos_profile_services_default,
        )
        node.create_service(
            SetLoggerLevels,
            f"{name}/set_logger_levels",
            _set_logger_levels,
            qos_profile=qos_profile_services_default,
        )


def _get_logger_levels(
    request: GetLoggerLevels.Request, response: GetLoggerLevels.Response
) -> GetLoggerLevels.Response:
    response.levels = [LoggerLevel(name=name, level=int(get_logger_level(name))) for name in request.names]
    return response


def _set_logger_levels(
    request: SetLoggerLevels.Request, response: SetLoggerLevels.Response
) -> SetLoggerLevels.Response:
    for level in request.levels:
        result = SetLoggerLevelsResult(successful=True)
        try:
            set_logger_level(level.name, level.level, detailed_error=True)
        except ValueError:
            result = SetLoggerLevelsResult(successful=False, reason="Failed reason: Invalid logger level.")
        response.results.append(result)
    return response
