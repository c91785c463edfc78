"""Validates topic and service names before expansion: relative, private or with substitutions."""

from __future__ import annotations

import re
from typing import Literal

from rclpy.exceptions import InvalidServiceNameException, InvalidTopicNameException

TOPIC_SEPARATOR_STRING = "/"


def validate_topic_name(name: str, *, is_service: bool = False) -> Literal[True]:
    """Check an unexpanded name; raises InvalidTopicNameException, or InvalidServiceNameException."""
    if problem := _problem(name):
        error = InvalidServiceNameException if is_service else InvalidTopicNameException
        raise error(name, *problem)
    return True


def _problem(name: str) -> tuple[str, int] | None:
    if not name:
        return "topic name must not be empty string", 0
    if name[0] in "0123456789":
        return "topic name token must not start with a number", 0
    if name[-1] == "/":
        return "topic name must not end with a forward slash", len(name) - 1
    if problem := _character_problem(name):
        return problem
    if number := re.search(r"/[0-9]", name):
        return "topic name token must not start with a number", number.end() - 1
    if name[0] == "~" and len(name) > 2 and name[1] != "/":
        return "topic name must not have a tilde '~' that is not followed by a forward slash '/'", 1
    return None


def _character_problem(name: str) -> tuple[str, int] | None:
    opened: int | None = None
    for index, character in enumerate(name):
        if character == "_" or (character.isascii() and character.isalnum()):
            if opened is not None and index == opened + 1 and character in "0123456789":
                return "substitution name must not start with a number", index
        elif character == "}":
            if opened is None:
                return "topic name must not have unmatched (unbalanced) curly braces '{}'", index
            opened = None
        elif character == "~":
            if index != 0:
                return "topic name must not have tilde '~' unless it is the first character", index
        elif opened is not None:
            return "substitution name must not contain characters other than alphanumerics or '_'", index
        elif character == "{":
            opened = index
        elif character != "/":
            message = "topic name must not contain characters other than alphanumerics, '_', '~', '{', or '}'"
            return message, index
    if opened is not None:
        return "topic name must not have unmatched (unbalanced) curly braces '{}'", opened
    return None
