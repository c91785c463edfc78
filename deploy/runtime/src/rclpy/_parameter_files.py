"""Reads parameter files, and values in YAML, as `rcl_yaml_param_parser` does.

A file maps names of nodes to `ros__parameters`, a tree of parameters. Names may be nested in namespaces and
contain the wildcards `*` and `**`.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import yaml

from rclpy import validate_node_name
from rclpy._parameter_scalars import plain_scalar
from rclpy.parameter import PARAMETER_SEPARATOR_STRING, Parameter

ParametersOfNodes: TypeAlias = dict[str, dict[str, Parameter]]
"""Node name or pattern -> parameter name -> parameter, in the order of the file."""

_PARAMETERS_KEY = "ros__parameters"
_STRING_TAG = "tag:yaml.org,2002:str"
_NO_TAG = ""
_QUOTES = ("'", '"')
_TOO_DEEP = "it is nested too deeply"
_KINDS = {bool: "bool", int: "integer", float: "double", str: "string"}


class ParameterFileError(ValueError):
    """Raised for an invalid parameter file; the message is one line with file, key and reason."""


def read_parameter_file(path: str) -> ParametersOfNodes:
    """Read a parameter file. Raises ParameterFileError if it cannot be read or is invalid."""
    try:
        with open(path, encoding="utf-8") as file:
            document = yaml.compose(file, Loader=_Loader)
    except OSError as error:
        raise ParameterFileError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ParameterFileError(f"{path}: {error}") from None
    except yaml.YAMLError as error:
        raise ParameterFileError(f"{path}: {_reason(error)}") from None
    except RecursionError:
        raise ParameterFileError(f"{path}: {_TOO_DEEP}") from None

    nodes: ParametersOfNodes = {}
    try:
        if document is not None:
            _read_nodes(document, "", nodes)
    except _InvalidKey as error:
        key = f"{error.key}: " if error.key else ""
        text = " ".join(f"{key}{error.reason}".split())  # a key may have several lines
        raise ParameterFileError(f"{path}: line {error.line}: {text}") from None
    return nodes


def parse_yaml_value(text: str) -> Any:
    """Convert a scalar or a list of scalars. Raises ValueError if the text is something else, or not YAML."""
    try:
        return _value(yaml.compose(text, Loader=_Loader))
    except yaml.YAMLError as error:
        raise ValueError(_reason(error)) from None
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None


class _Loader(yaml.SafeLoader):
    """Composes nodes, leaves plain scalars untagged, and rejects aliases, as ROS 2 does."""

    def resolve(self, kind: type[yaml.Node], value: Any, implicit: Any) -> str:
        if kind is yaml.ScalarNode:
            return _NO_TAG
        tag: str = super().resolve(kind, value, implicit)  # type: ignore[no-untyped-call]
        return tag

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.composer.ComposerError(None, None, "aliases are not supported", mark)
        return super().compose_node(parent, index)


class _InvalidKey(Exception):
    def __init__(self, node: yaml.Node, key: str, reason: str) -> None:
        self.line = node.start_mark.line + 1
        self.key = key
        self.reason = reason


def _read_nodes(mapping: yaml.Node, namespace: str, nodes: ParametersOfNodes) -> None:
    for key_node, value_node in _items(mapping, namespace, "names of nodes"):
        name = key_node.value
        if name != _PARAMETERS_KEY:
            _read_nodes(value_node, _join(namespace, name), nodes)
            continue
        if not namespace:
            raise _InvalidKey(key_node, name, "there is no node name above it")
        _check_node_name(key_node, namespace)
        if not _is_empty(value_node):
            _read_parameters(value_node, namespace, "", nodes.setdefault(namespace, {}))


def _read_parameters(mapping: yaml.Node, node: str, prefix: str, parameters: dict[str, Parameter]) -> None:
    for key_node, value_node in _items(mapping, f"{node}: {prefix}".rstrip(": ."), "parameters"):
        name = f"{prefix}{key_node.value}"
        if isinstance(value_node, yaml.MappingNode):
            _read_parameters(value_node, node, f"{name}{PARAMETER_SEPARATOR_STRING}", parameters)
            continue
        try:
            parameters[name] = Parameter(name, value=_value(value_node))
        except ValueError as error:
            raise _InvalidKey(value_node, f"{node}: {name}", str(error)) from None


def _items(mapping: yaml.Node, key: str, content: str) -> list[tuple[yaml.ScalarNode, yaml.Node]]:
    if not isinstance(mapping, yaml.MappingNode):
        raise _InvalidKey(mapping, key, f"expected a mapping of {content}, found {_describe(mapping)}")
    items: list[tuple[yaml.ScalarNode, yaml.Node]] = mapping.value
    for key_node, _ in items:
        if not isinstance(key_node, yaml.ScalarNode) or not key_node.value:
            raise _InvalidKey(key_node, key, "a key must be a name")
    return items


def _describe(node: yaml.Node) -> str:
    if isinstance(node, yaml.ScalarNode):
        return f"'{node.value}'" if node.value else "nothing"
    return "a list" if isinstance(node, yaml.SequenceNode) else "a mapping"


def _is_empty(node: yaml.Node) -> bool:
    return isinstance(node, yaml.ScalarNode) and not node.value and node.style not in _QUOTES


def _join(namespace: str, name: str) -> str:
    """Append a key to the node name that the enclosing keys make."""
    return f"{namespace.rstrip('/')}/{name.lstrip('/')}" if namespace else name


def _check_node_name(key_node: yaml.Node, name: str) -> None:
    for token in name.removeprefix("/").split("/"):
        if token not in ("*", "**") and (problem := validate_node_name._problem(token)):
            raise _InvalidKey(key_node, name, problem[0])


def _value(node: yaml.Node | None) -> Any:
    """Convert a scalar or a list of one type; an empty list is `None`, as in ROS 2. Raises ValueError."""
    if isinstance(node, yaml.ScalarNode) and not _is_empty(node):
        return _scalar(node)
    if not isinstance(node, yaml.SequenceNode):
        raise ValueError(
            "a mapping is not a value" if isinstance(node, yaml.MappingNode) else "it has no value"
        )
    values = []
    for item in node.value:
        if not isinstance(item, yaml.ScalarNode) or _is_empty(item):
            raise ValueError(f"a list may contain scalars only, found {_describe(item)}")
        values.append(_scalar(item))
    kinds = dict.fromkeys(_KINDS[type(value)] for value in values)
    if len(kinds) > 1:
        raise ValueError(f"the elements of a list must be of one type, found {' and '.join(kinds)}")
    return values or None


def _scalar(node: yaml.ScalarNode) -> bool | int | float | str:
    """Type a scalar by its text, unless quotes or `!!str` make it a string. ROS 2 ignores other tags."""
    text = str(node.value)
    return text if node.tag == _STRING_TAG or node.style in _QUOTES else plain_scalar(text)


def _reason(error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or str(error)
    place = f"line {mark.line + 1}: " if mark else ""
    return " ".join(f"{place}{problem}".split())
