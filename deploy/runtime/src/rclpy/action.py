"""Actions: not there. Every name can be imported, and raises NotImplementedError when it is used."""

from __future__ import annotations

from typing import Any, NoReturn

from rclpy._not_there import NotThere, text


class ActionClient(NotThere):
    """Not there."""


class ActionServer(NotThere):
    """Not there."""


class CancelResponse(NotThere):
    """Not there."""


class GoalResponse(NotThere):
    """Not there."""


def get_action_client_names_and_types_by_node(*_: Any, **__: Any) -> NoReturn:
    """Not there: raises NotImplementedError."""
    raise NotImplementedError(text(get_action_client_names_and_types_by_node))


def get_action_names_and_types(*_: Any, **__: Any) -> NoReturn:
    """Not there: raises NotImplementedError."""
    raise NotImplementedError(text(get_action_names_and_types))


def get_action_server_names_and_types_by_node(*_: Any, **__: Any) -> NoReturn:
    """Not there: raises NotImplementedError."""
    raise NotImplementedError(text(get_action_server_names_and_types_by_node))
