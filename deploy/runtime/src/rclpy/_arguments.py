"""Parses the ROS arguments of a command line: those between `--ros-args` and `--`.

Source of the grammar: docs.ros.org, "Passing ROS arguments to nodes via the command-line".
`_parameter_values` parses the values of `-p`, `_parameter_files` the files of `--params-file`.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from rclpy._parameter_values import parse_value
from rclpy.exceptions import RCLInvalidROSArgsError, UnknownROSArgsError
from rclpy.expand_topic_name import expand_topic_name
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.parameter import Parameter

if TYPE_CHECKING:
    from rclpy._parameter_files import ParametersOfNodes

_TOKEN = "[A-Za-z_][A-Za-z0-9_]*"
_NAME = rf"(?:~/|/)?{_TOKEN}(?:/{_TOKEN})*"
_NODE_PREFIX = rf"(?:(?P<node>{_TOKEN}):)?"
_RENAME_NODE = re.compile(rf"{_NODE_PREFIX}__(?:node|name):=(?P<to>{_TOKEN})")
_MOVE_NODE = re.compile(rf"{_NODE_PREFIX}__ns:=(?P<to>/(?:{_TOKEN}(?:/{_TOKEN})*)?)")
_NO_NODE = "(?!__(?:node|name|ns):)"
_KIND = "(?P<kind>rostopic://|rosservice://)?"
_REMAP = re.compile(rf"{_NODE_PREFIX}{_KIND}{_NO_NODE}(?P<from>{_NAME}):=(?P<to>{_NAME})")
# Matched by character: with repeated tokens, rejecting a name could take exponential time.
_PARAMETER_NAME_PART = r"[A-Za-z_/](?:[A-Za-z_/]|(?<!/)[0-9])*"
_PARAMETER_NAME = rf"{_PARAMETER_NAME_PART}(?:\.{_PARAMETER_NAME_PART})*"
_PARAMETER = re.compile(rf"{_NODE_PREFIX}(?P<name>{_PARAMETER_NAME}):=(?P<value>.+)", re.DOTALL)
_ALL_NODES = "/**"


@dataclass(frozen=True, slots=True)
class RemapRule:
    """`[node:][kind]match:=replacement`; `match` is `__node`, `__ns` or a name of a topic or service."""

    match: str
    replacement: str
    node: str | None = None
    kind: str | None = None

    def applies_to(self, node_name: str) -> bool:
        """Return whether the rule applies to the node with that name."""
        return self.node is None or self.node == node_name


@dataclass(frozen=True, slots=True)
class RosArguments:
    """The ROS arguments of a process, which apply to its nodes.

    `log_level` is the default level (`None`: not given), `log_levels` maps names of loggers to their levels.
    `remaining` is the command line without its ROS arguments.
    """

    remaps: tuple[RemapRule, ...] = ()
    parameters: tuple[ParametersOfNodes, ...] = ()
    log_level: LoggingSeverity | None = None
    log_levels: dict[str, LoggingSeverity] = field(default_factory=dict)
    stdout_logs: bool = True
    rosout_logs: bool = True
    enclave: str = "/"
    remaining: list[str] = field(default_factory=list)

    def before(self, fallback: RosArguments) -> RosArguments:
        """Return a node's arguments: its remaps and parameters come first, the rest is its process'."""
        return replace(
            fallback, remaps=self.remaps + fallback.remaps, parameters=fallback.parameters + self.parameters
        )

    def node_name(self, name: str, namespace: str) -> tuple[str, str]:
        """Return name and namespace of a node after remapping."""
        name = self._replacement("__node", name) or name
        # The prefixes of further rules refer to the new name.
        return name, self._replacement("__ns", name) or namespace

    def remap_topic(self, fqn: str, node_name: str, node_namespace: str) -> str:
        """Return the fully qualified name that the node uses for its topic `fqn`."""
        return self._remap(fqn, node_name, node_namespace, "rosservice://")

    def remap_service(self, fqn: str, node_name: str, node_namespace: str) -> str:
        """Return the fully qualified name that the node uses for its service `fqn`."""
        return self._remap(fqn, node_name, node_namespace, "rostopic://")

    def parameter_overrides(self, fqn: str) -> dict[str, Parameter]:
        """Return the parameters given for the node with the fully qualified name `fqn`."""
        overrides: dict[str, Parameter] = {}
        for source in self.parameters:
            for pattern, parameters in source.items():
                if _matches(pattern, fqn):
                    overrides.update(parameters)
        return overrides

    def _replacement(self, match: str, node_name: str) -> str | None:
        rules = (rule for rule in self.remaps if rule.match == match and rule.applies_to(node_name))
        return next((rule.replacement for rule in rules), None)

    def _remap(self, fqn: str, node_name: str, node_namespace: str, other_kind: str) -> str:
        for rule in self.remaps:
            if rule.match in ("__node", "__ns") or rule.kind == other_kind:
                continue
            if not rule.applies_to(node_name):
                continue
            if expand_topic_name(rule.match, node_name, node_namespace) == fqn:
                return expand_topic_name(rule.replacement, node_name, node_namespace)
        return fqn


def parse(argv: list[str] | None) -> RosArguments:
    """Parse a command line, by default `sys.argv`.

    :raises RCLInvalidROSArgsError: if a ROS argument has an invalid value; the message is one line.
    :raises UnknownROSArgsError: if a ROS argument is unknown.
    :raises NotImplementedError: if this runtime does not support a ROS argument.
    """
    return _Parser(sys.argv if argv is None else argv).parse()


def remove_ros_args(argv: list[str] | None) -> list[str]:
    """Return a command line (by default `sys.argv`) without its ROS arguments; do not check those."""
    remaining = []
    ros = False
    for argument in sys.argv if argv is None else argv:
        if argument == "--ros-args":
            ros = True
        elif ros and argument == "--":
            ros = False
        elif not ros and not _as_rule(argument):
            remaining.append(argument)
    return remaining


class _Parser:
    def __init__(self, argv: list[str]) -> None:
        self._argv = argv
        self._remaps: list[RemapRule] = []
        self._parameters: ParametersOfNodes = {}
        self._log_level: LoggingSeverity | None = None
        self._log_levels: dict[str, LoggingSeverity] = {}
        self._switches = {"stdout": True, "rosout": True, "external-lib": True}
        self._enclave = "/"

    def parse(self) -> RosArguments:
        readers = {
            "-r": self._remap,
            "--remap": self._remap,
            "-p": self._parameter,
            "--param": self._parameter,
            "--params-file": self._parameter_file,
            "--log-level": self._level,
            "-e": self._set_enclave,
            "--enclave": self._set_enclave,
            "--log-config-file": self._unsupported,
            "--log-file-name": self._unsupported,
        }
        remaining: list[str] = []
        unknown: list[str] = []
        ros = False
        arguments = iter(self._argv)
        for argument in arguments:
            if argument == "--ros-args":
                ros = True
            elif not ros:
                # Before `--ros-args` existed, remap rules were plain arguments. ROS 2 still accepts them.
                if rule := _as_rule(argument):
                    self._remaps.append(rule)
                    RcutilsLogger("rcl").warning(
                        f"Found remap rule '{argument}'. This syntax is deprecated. "
                        f"Use '--ros-args --remap {argument}' instead."
                    )
                else:
                    remaining.append(argument)
            elif argument == "--":
                ros = False
            elif reader := readers.get(argument):
                value = next(arguments, None)
                if value is None:
                    raise RCLInvalidROSArgsError(f"Failed to parse ROS arguments: {argument} needs a value")
                reader(argument, value)
            elif switch := re.fullmatch("--(enable|disable)-(stdout|rosout|external-lib)-logs", argument):
                self._switches[switch[2]] = switch[1] == "enable"
            else:
                unknown.append(argument)
        if unknown:
            raise UnknownROSArgsError(f"Found unknown ROS arguments: {unknown}")
        return RosArguments(
            remaps=tuple(self._remaps),
            parameters=(self._parameters,),
            log_level=self._log_level,
            log_levels=self._log_levels,
            stdout_logs=self._switches["stdout"],
            rosout_logs=self._switches["rosout"],
            enclave=self._enclave,
            remaining=remaining,
        )

    def _remap(self, flag: str, value: str) -> None:
        rule = _as_rule(value)
        if not rule:
            raise _invalid(
                flag, value, "expected [node:]from:=to, where from is a topic, a service, __node or __ns"
            )
        self._remaps.append(rule)

    def _parameter(self, flag: str, value: str) -> None:
        rule = _PARAMETER.fullmatch(value)
        if not rule:
            raise _invalid(flag, value, "expected [node:]name:=value")
        name = rule["name"]
        try:
            parameter = Parameter(name, value=parse_value(rule["value"]))
        except ValueError as error:
            raise _invalid(flag, value, str(error)) from None
        self._parameters.setdefault(rule["node"] or _ALL_NODES, {})[name] = parameter

    def _parameter_file(self, flag: str, value: str) -> None:
        # Imported on use: a YAML parser takes time to import.
        from rclpy._parameter_files import ParameterFileError, read_parameter_file

        try:
            nodes = read_parameter_file(value)
        except ParameterFileError as error:
            raise RCLInvalidROSArgsError(f"Failed to parse ROS arguments: {error}") from None
        for node, parameters in nodes.items():
            self._parameters.setdefault(node, {}).update(parameters)

    def _level(self, flag: str, value: str) -> None:
        logger, separator, level = value.rpartition(":=")
        try:
            severity = LoggingSeverity[level.upper()]
        except KeyError:
            names = ", ".join(severity.name.lower() for severity in LoggingSeverity)
            raise _invalid(flag, value, f"'{level}' is not a severity ({names})") from None
        if not separator:
            self._log_level = severity
        elif logger:
            self._log_levels[logger] = severity
        else:
            raise _invalid(flag, value, "the name of the logger is empty")

    def _set_enclave(self, flag: str, value: str) -> None:
        self._enclave = value

    def _unsupported(self, flag: str, value: str) -> None:
        raise NotImplementedError(f"{flag}: not supported: this runtime writes no log files")


def _as_rule(argument: str) -> RemapRule | None:
    """Parse a remap rule; `None` if the argument is not one."""
    if match := _RENAME_NODE.fullmatch(argument):
        return RemapRule("__node", match["to"], match["node"])
    if match := _MOVE_NODE.fullmatch(argument):
        return RemapRule("__ns", match["to"], match["node"])
    if match := _REMAP.fullmatch(argument):
        return RemapRule(match["from"], match["to"], match["node"], match["kind"])
    return None


def _matches(pattern: str, fqn: str) -> bool:
    """Return whether a node name of a parameter file, with or without wildcards, matches the node `fqn`."""
    absolute = pattern if pattern.startswith("/") else f"/{pattern}"
    # `/*` matches one token, `/**` any number of tokens.
    expression = re.escape(absolute).replace(r"/\*\*", r"(/\w+)*").replace(r"/\*", r"/\w+")
    return re.fullmatch(expression, fqn) is not None


def _invalid(flag: str, value: str, reason: str) -> RCLInvalidROSArgsError:
    return RCLInvalidROSArgsError(f"Failed to parse ROS arguments: '{flag} {value}': {reason}")
