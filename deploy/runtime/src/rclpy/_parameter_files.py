"""
Parameter values and files as `rcl_yaml_param_parser` reads them.

A file maps names of nodes, which may be nested in namespaces and contain the wildcards `*` and `**`, to
`ros__parameters`, a tree of parameters. Its scalars are typed by rules of their own, a bit wider than YAML's.
"""

from __future__ import annotations

import functools
import math
import re
from typing import TYPE_CHECKING, Any, TypeAlias

from rclpy import validate_node_name
from rclpy.parameter import PARAMETER_SEPARATOR_STRING, Parameter

if TYPE_CHECKING:
    import yaml

NodeParameters: TypeAlias = dict[str, dict[str, Parameter]]
"""Node name or pattern -> parameter name -> parameter, in the order of their first appearance."""

_PARAMETERS_KEY = "ros__parameters"
_TRUE = {"Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"}
_FALSE = {"N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"}
_INTEGER = re.compile(r"[+-]?(?:(?P<hexadecimal>0[xX][0-9a-fA-F]+)|(?P<octal>0[0-7]*)|[1-9][0-9]*)")
_FLOAT = re.compile(
    r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?\.?(?:inf|infinity|nan)", re.IGNORECASE
)
# What makes a text more than a plain scalar, or may: only a YAML parser knows.
_NOT_PLAIN = re.compile(r"""[\[\]{}'"!&*|>#%@`:,?\\\s]|^-$|^---|^\.\.\.""")
_STRING_TAG = "tag:yaml.org,2002:str"
_PLAIN_TAG = "plain"
_KINDS = {bool: "bool", int: "integer", float: "double", str: "string"}


class ParameterFileError(ValueError):
    """Raised for a parameter file that cannot be used; the message is one line with file, key and reason."""


def parse_value(text: str) -> Any:
    """
    Convert the value of `-p name:=value`.

    :raises ValueError: if it is empty, no valid YAML, or neither a scalar nor a list of scalars of one type.
    """
    # Plain scalars, the usual case, need no YAML parser.
    if not _NOT_PLAIN.search(text):
        return _plain_scalar(text)
    import yaml

    try:
        return _value(yaml.compose(text, Loader=_loader()))
    except yaml.YAMLError as error:
        raise ValueError(_reason(error)) from None


def read_parameter_file(path: str) -> NodeParameters:
    """
    Read a parameter file.

    :raises ParameterFileError: if it cannot be read or used.
    """
    import yaml

    try:
        with open(path, encoding="utf-8") as file:
            document = yaml.compose(file, Loader=_loader())
    except OSError as error:
        raise ParameterFileError(f"{path}: {error.strerror}") from None
    except yaml.YAMLError as error:
        raise ParameterFileError(f"{path}: {_reason(error)}") from None
    except UnicodeDecodeError as error:
        raise ParameterFileError(f"{path}: {error}") from None

    nodes: NodeParameters = {}
    try:
        if document is not None:
            _read_nodes(document, "", nodes)
    except _Mistake as mistake:
        key = f"{mistake.key}: " if mistake.key else ""
        raise ParameterFileError(f"{path}, line {mistake.line}: {key}{mistake.reason}") from None
    return nodes


class _Mistake(Exception):
    """A mistake at a key of a file."""

    def __init__(self, node: yaml.Node, key: str, reason: str) -> None:
        self.line = node.start_mark.line + 1
        self.key = key
        self.reason = reason


def _read_nodes(mapping: yaml.Node, namespace: str, nodes: NodeParameters) -> None:
    """Collect the parameters of the nodes in `namespace`."""
    for key_node, value_node in _items(mapping, namespace, "names of nodes"):
        name = key_node.value
        if name == _PARAMETERS_KEY:
            if not namespace:
                raise _Mistake(key_node, name, "there is no node name above it")
            _check_node_name(key_node, namespace)
            if not _is_empty(value_node):
                _read_parameters(value_node, namespace, "", nodes.setdefault(namespace, {}))
        else:
            _read_nodes(value_node, _join(namespace, name), nodes)


def _read_parameters(mapping: yaml.Node, node: str, prefix: str, parameters: dict[str, Parameter]) -> None:
    """Collect the parameters below `prefix`."""
    for key_node, value_node in _items(mapping, f"{node}: {prefix}".rstrip(": ."), "parameters"):
        name = f"{prefix}{key_node.value}"
        if value_node.id == "mapping":
            _read_parameters(value_node, node, f"{name}{PARAMETER_SEPARATOR_STRING}", parameters)
            continue
        try:
            parameters[name] = Parameter(name, value=_value(value_node))
        except ValueError as error:
            raise _Mistake(value_node, f"{node}: {name}", str(error)) from None


def _items(mapping: yaml.Node, key: str, content: str) -> list[tuple[yaml.ScalarNode, yaml.Node]]:
    """Return the items of a mapping with scalar keys."""
    if mapping.id != "mapping":
        raise _Mistake(mapping, key, f"expected a mapping of {content}, found {_describe(mapping)}")
    for key_node, _ in mapping.value:
        if key_node.id != "scalar" or not key_node.value:
            raise _Mistake(key_node, key, "a key must be a name")
    items: list[tuple[yaml.ScalarNode, yaml.Node]] = mapping.value
    return items


def _describe(node: yaml.Node) -> str:
    if node.id != "scalar":
        return f"a {node.id}"
    return f"'{node.value}'" if node.value else "nothing"


def _is_empty(node: yaml.Node) -> bool:
    return node.tag == _PLAIN_TAG and not node.value


def _join(namespace: str, name: str) -> str:
    """Append a key to the node name that the keys above it make."""
    if not namespace:
        return name
    return f"{namespace.rstrip('/')}/{name.lstrip('/')}"


def _check_node_name(key_node: yaml.Node, name: str) -> None:
    tokens = name.removeprefix("/").split("/")
    for token in tokens:
        if token in ("*", "**"):
            continue
        if problem := validate_node_name._problem(token):
            raise _Mistake(key_node, name, problem[0])


def _value(node: yaml.Node | None) -> Any:
    """
    Convert a scalar or a list of scalars.

    :raises ValueError: if it has no value, or none that a parameter can have.
    """
    if node is None or _is_empty(node):
        raise ValueError("it has no value")
    if node.id == "scalar":
        return _scalar(node)
    if node.id != "sequence":
        raise ValueError("a mapping is no value of a parameter")
    values = []
    for item in node.value:
        if item.id != "scalar":
            raise ValueError(f"a list may contain scalars only, found a {item.id}")
        values.append(_scalar(item))
    kinds = [_KINDS[type(value)] for value in values]
    if len(set(kinds)) > 1:
        found = " and ".join(dict.fromkeys(kinds))
        raise ValueError(f"the elements of a list must be of one type, found {found}")
    return values


def _scalar(node: yaml.ScalarNode) -> Any:
    return _plain_scalar(node.value) if node.tag == _PLAIN_TAG else node.value


def _plain_scalar(text: str) -> bool | int | float | str:
    """Type a scalar without quotes as C's strtoll and strtod do: an integer beyond 64 bits is a double."""
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    if number := _INTEGER.fullmatch(text):
        integer = int(text, 16 if number["hexadecimal"] else 8 if number["octal"] else 10)
        if -(2**63) <= integer < 2**63:
            return integer
    if _FLOAT.fullmatch(text):
        value = float(re.sub(r"\.(?=[in])", "", text.lower()))
        if math.isfinite(value) or not text[-1].isdigit():
            return value
    return text


@functools.cache
def _loader() -> type[yaml.SafeLoader]:
    """Return a loader that composes nodes, tells plain scalars from quoted ones and refuses aliases."""
    import yaml

    class Loader(yaml.SafeLoader):
        def resolve(self, kind: type[yaml.Node], value: Any, implicit: Any) -> str:
            if kind is yaml.ScalarNode:
                return _PLAIN_TAG if implicit[0] else _STRING_TAG
            return str(super().resolve(kind, value, implicit))

        def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
            if self.check_event(yaml.AliasEvent):
                mark = self.peek_event().start_mark
                raise yaml.composer.ComposerError(None, None, "aliases are not supported", mark)
            return super().compose_node(parent, index)

    return Loader


def _reason(error: yaml.YAMLError) -> str:
    """Say in one line what is wrong with a YAML text, and where."""
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or str(error)
    place = f"line {mark.line + 1}: " if mark else ""
    return " ".join(f"{place}{problem}".split())
