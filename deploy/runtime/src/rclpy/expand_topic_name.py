"""Expands names of topics and services to fully qualified names."""

from __future__ import annotations

import re

from rclpy import validate_namespace, validate_node_name, validate_topic_name

__all__ = ["expand_topic_name"]


def expand_topic_name(topic_name: str, node_name: str, node_namespace: str) -> str:
    """Expand `topic_name` for the node `node_name` in `node_namespace`.

    `chatter` is relative to the namespace, `~/chatter` private to the node, `/chatter` absolute. `{node}`,
    `{ns}` and `{namespace}` are replaced. The result may still be invalid: see `validate_full_topic_name`.

    :raises ValueError: if an argument is invalid or a substitution unknown.
    """
    _raise_if("topic name", topic_name, validate_topic_name._problem(topic_name))
    _raise_if("node name", node_name, validate_node_name._problem(node_name))
    _raise_if("node namespace", node_namespace, validate_namespace._problem(node_namespace))

    prefix = node_namespace.rstrip("/")
    expanded = topic_name
    if expanded.startswith("~"):
        expanded = f"{prefix}/{node_name}{expanded[1:]}"
    if "{" in expanded:
        values = {"{node}": node_name, "{ns}": node_namespace, "{namespace}": node_namespace}
        for substitution in re.findall(r"{[^}]*}", expanded):
            if substitution not in values:
                message = f"unknown substitution: {substitution}"
                raise ValueError(f"topic name '{topic_name}' is invalid: {message}")
            expanded = expanded.replace(substitution, values[substitution])
    return expanded if expanded.startswith("/") else f"{prefix}/{expanded}"


def _raise_if(what: str, name: str, problem: tuple[str, int] | None) -> None:
    if problem:
        raise ValueError(f"{what} '{name}' is invalid: {problem[0]}")
