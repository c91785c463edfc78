"""The contract: one table of all topics.

Names are relative, so a whole arm fits under a namespace (``__ns:=/arm1``). Units are SI and radians (REP
103). Services take name, type and QoS of their topics from these rows, and the README shows :func:`markdown`.
Recipes work with values, see :attr:`Topic.value`. A value with a :attr:`Topic.problem` is dropped at the edge
of a service, counted and reported.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, KeyValue
from geometry_msgs.msg import Point, PointStamped, Twist, TwistStamped, Vector3
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState, TimeReference
from std_msgs.msg import Bool, Float64, Header, String

from interfaces import cause
from interfaces.limits import LARGEST, LARGEST_MESSAGE, bad_report
from reactive_node import stamps

try:
    from tf2_msgs.msg import TFMessage
except ModuleNotFoundError:  # ROS 2's wheels on PyPI do not have it
    TFMessage = "tf2_msgs/msg/TFMessage"

TURN_ON, TURN_OFF = "turn_on", "turn_off"
ON, OFF = "on", "off"
ALIVE, MISSED, INCAPACITATED = "alive", "missed", "incapacitated"
DRIVE_TIMEOUT = 0.4  # s for which the engines' drive accepts an `on`
CLOCK_TOLERANCE = 0.05  # s between the clocks of two hosts (deploy/SAFETY.md, A3)
FRAME = "base"
LONGEST_NAME = 255  # characters of the name of a node

Conversion = Callable[[Any], Any]


class Position(NamedTuple):
    """A position of the effector."""

    stamp: int
    """When it was emitted [ns since 1970]; a datetime would round it to microseconds."""
    x: float  # [m]
    y: float  # [m]
    frame: str = FRAME


def _position(message: PointStamped) -> Position:
    header, point = message.header, message.point
    stamp = header.stamp
    return Position(stamp.sec * 10**9 + stamp.nanosec, point.x, point.y, header.frame_id)


def _point(position: Position) -> PointStamped:
    stamp, x, y, frame = position
    header = Header(stamp=stamps.time_message(stamp), frame_id=frame)
    return PointStamped(header=header, point=Point(x=x, y=y))


class PlanarTwist(NamedTuple):
    """How the effector moves in its plane."""

    stamp: int
    """When it was true [ns since 1970]."""
    x: float  # [m/s]
    y: float  # [m/s]
    turn: float  # [rad/s]
    frame: str = FRAME

    @property
    def speed(self) -> float:
        """How fast the effector moves [m/s]."""
        return math.hypot(self.x, self.y)


def _planar_twist(message: TwistStamped) -> PlanarTwist:
    header, linear = message.header, message.twist.linear
    stamp = header.stamp.sec * 10**9 + header.stamp.nanosec
    return PlanarTwist(stamp, linear.x, linear.y, message.twist.angular.z, header.frame_id)


def _twist_stamped(twist: PlanarTwist) -> TwistStamped:
    stamp, x, y, turn, frame = twist
    header = Header(stamp=stamps.time_message(stamp), frame_id=frame)
    return TwistStamped(header=header, twist=Twist(linear=Vector3(x=x, y=y), angular=Vector3(z=turn)))


class DrivenTime(NamedTuple):
    """For how long a drive has moved the joints."""

    stamp: int
    """When it was published [ns since 1970]."""
    seconds: float
    source: str
    """The host of the drive: :func:`interfaces.service.host.identity`."""
    host: str
    """The name of its host, for people."""


def _driven_time(message: TimeReference) -> DrivenTime:
    stamp, time = message.header.stamp, message.time_ref
    return DrivenTime(
        stamp.sec * 10**9 + stamp.nanosec,
        time.sec + time.nanosec / 1e9,
        message.source,
        message.header.frame_id,
    )


def _time_reference(driven: DrivenTime) -> TimeReference:
    header = Header(stamp=stamps.time_message(driven.stamp), frame_id=driven.host)
    time = stamps.time_message(round(driven.seconds * 1e9))
    return TimeReference(header=header, time_ref=time, source=driven.source)


class Sender(NamedTuple):
    """The sender of a command to the engines."""

    command: str
    node: str


_CONVERSIONS: dict[Any, tuple[Conversion, Conversion]] = {
    Bool: (attrgetter("data"), lambda value: Bool(data=value)),
    Float64: (attrgetter("data"), lambda value: Float64(data=value)),
    String: (attrgetter("data"), lambda value: String(data=value)),
    KeyValue: (
        lambda message: Sender(message.key, message.value),
        lambda sender: KeyValue(key=sender.command, value=sender.node),
    ),
    PointStamped: (_position, _point),
    TimeReference: (_driven_time, _time_reference),
    TwistStamped: (_planar_twist, _twist_stamped),
    Header: (
        lambda message: stamps.from_message(message.stamp),
        lambda time: Header(stamp=stamps.to_message(time)),
    ),
}
"""From a message of a type to its value, and back. A message of another type is its own value."""


def _unchanged(message: Any) -> Any:
    return message


@dataclass(frozen=True)
class Topic:
    """A row of the contract."""

    name: str
    type: Any
    """The class of its messages; its name where that is not installed."""
    qos: QoSProfile
    unit: str
    publishers: tuple[str, ...]
    """The nodes that publish it."""
    subscribers: tuple[str, ...]
    """The nodes of the arm that read it, then tools for which it is made."""
    meaning: str
    problem: Callable[[Any], str] = lambda value: ""
    """Return what is wrong with a value; empty for a good one."""
    longest_gap: float = 0.25
    """The longest time [s] between two messages while the arm moves and its operator is present; infinite for
    a topic that reports single events, or that is silent while it does not know."""
    follows: str = ""
    """The name of the topic without which this one falls silent; empty if there is none."""
    raw: bool = False
    """Whether its values are whole messages, whatever their type."""
    largest: int = LARGEST_MESSAGE
    """A message of more octets is dropped before it is deserialized."""

    @cached_property
    def value(self) -> Conversion:
        """Return the value of a message: its ``data``, a :class:`Position`, a datetime, or the message."""
        return _CONVERSIONS.get(self._converted, (_unchanged, _unchanged))[0]

    @cached_property
    def message(self) -> Conversion:
        """Return the message of a value: the inverse of :attr:`value`."""
        return _CONVERSIONS.get(self._converted, (_unchanged, _unchanged))[1]

    @property
    def _converted(self) -> Any:
        return None if self.raw else self.type

    @property
    def type_name(self) -> str:
        """The type as ROS 2 names it, for example ``std_msgs/msg/Float64``."""
        if isinstance(self.type, str):
            return self.type
        package, kind = self.type.__module__.split(".")[:2]
        return f"{package}/{kind}/{self.type.__name__}"

    def full_name(self, namespace: str) -> str:
        """Return the name in the namespace of an arm."""
        return self.name if self.name[0] == "/" else f"{namespace.rstrip('/')}/{self.name}"


def _not_usable(*numbers: float) -> str:
    for number in numbers:  # a generator would cost a call for each
        if not abs(number) <= LARGEST:  # nor is NaN
            shown = numbers if len(numbers) > 1 else number
            is_finite = all(map(math.isfinite, numbers))
            return f"{shown} is not {f'from {-LARGEST:g} to {LARGEST:g}' if is_finite else 'finite'}"
    return ""


def _not_a_length(value: float) -> str:
    return _not_usable(value) or ("" if value >= 0 else f"{value} is negative")


def _not_a_name(name: str) -> str:
    return "" if 0 < len(name) <= LONGEST_NAME else f"{name[:40]!r} is no name of a node"


def _not_one_of(*known: str) -> Callable[[str], str]:
    return lambda value: "" if value in known else f"{value[:40]!r} is unknown"


def _qos(
    depth: int,
    *,
    reliable: bool = True,
    latched: bool = False,
    lifespan: float | None = None,
) -> QoSProfile:
    """``latched``: a late or restarted reader gets the last ``depth`` messages at once; ``lifespan`` [s]."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        lifespan=Duration() if lifespan is None else Duration(seconds=lifespan),
    )


_STATE = _qos(1, latched=True)
_EVENTS = _qos(10)

OPERATOR_NODES = ("terminal", "operator_page")
"""The nodes that show the arm to its operator."""
FLEET = "fleet"
"""The node of `make fleet`, which shows many arms."""
_VIEWERS = ("RViz", "Foxglove")
_CONFIGURED = ("kinematics", "twist", "robot_state", *OPERATOR_NODES)
EVERY_SERVICE = "every service"
"""In place of the names of all programs of the arm."""

L1 = Topic("l1", Float64, _STATE, "m", ("config_l1",), _CONFIGURED, "length of the first link", _not_a_length)
L2 = Topic(
    "l2", Float64, _STATE, "m", ("config_l2",), _CONFIGURED, "length of the second link", _not_a_length
)
DRIVEN_TIME = Topic(
    "driven_time",
    TimeReference,
    _qos(1, lifespan=DRIVE_TIMEOUT),
    "s",
    ("drive",),
    ("config_theta1", "config_theta2", *OPERATOR_NODES),
    "`time_ref`: for how long the drive has moved the joints; only in a scenario with a drive, by which they "
    "then move. `source`: the host of the drive. A joint follows that of its own host, and reports others",
    lambda driven: _not_a_length(driven.seconds),
)
THETA1 = Topic(
    "theta1",
    Float64,
    _STATE,
    "rad",
    ("config_theta1",),
    _CONFIGURED,
    "angle of the first joint",
    _not_usable,
    follows=DRIVEN_TIME.name,
)
THETA2 = Topic(
    "theta2",
    Float64,
    _STATE,
    "rad",
    ("config_theta2",),
    _CONFIGURED,
    "angle of the second joint",
    _not_usable,
    follows=DRIVEN_TIME.name,
)
EFFECTOR_POSITION = Topic(
    "effector/position",
    PointStamped,
    _STATE,
    "m",
    ("kinematics",),
    ("velocity", *OPERATOR_NODES),
    f"x, y in frame `{FRAME}`; `header.stamp` is the time of emission",
    lambda position: _not_usable(position.x, position.y),
)
EFFECTOR_SPEED = Topic(
    "effector/speed",
    Float64,
    _EVENTS,
    "m/s",
    ("velocity",),
    OPERATOR_NODES,
    "never negative",
    _not_a_length,
    follows=EFFECTOR_POSITION.name,
)
EFFECTOR_TWIST = Topic(
    "effector/twist",
    TwistStamped,
    _EVENTS,
    "m/s, rad/s",
    ("twist",),
    ("operator_page",),
    f"x, y and the turn about z in frame `{FRAME}`, at 50 Hz; true at the time in `header.stamp`. "
    "Silent while it is unknown: where a movement begins or ends, and while a source is dead",
    lambda twist: _not_usable(twist.x, twist.y, twist.turn),
    longest_gap=math.inf,
)
JOINT_STATES = Topic(
    "joint_states",
    JointState,
    _EVENTS,
    "rad",
    ("robot_state",),
    _VIEWERS,
    "angles of the joints `theta1` and `theta2`, all of one time",
)
ROBOT_DESCRIPTION = Topic(
    "robot_description",
    String,
    _STATE,
    "m",
    ("robot_state",),
    _VIEWERS,
    "URDF of the arm; a new one when `l1` or `l2` has changed",
    longest_gap=math.inf,
)
TF = Topic(
    "/tf",
    TFMessage,
    _qos(100),  # as of tf2_ros
    "m, rad",
    ("robot_state",),
    _VIEWERS,
    f"from `{FRAME}` to `link1`, `link2` and `effector`, all of one time; only where the package tf2_msgs is "
    "installed",
)
OPERATOR_HEARTBEAT = Topic(
    "operator_heartbeat",
    Bool,
    _qos(1, reliable=False),
    "",
    ("dead_mans_switch", *OPERATOR_NODES),
    ("operator_watchdog", *OPERATOR_NODES),
    "`true` while the switch is pressed, at 20 Hz or much faster. Neither `false` nor a heartbeat that "
    "waited in a queue is a sign of life",
    lambda beat: "" if beat else "a released switch is no sign of life",
)
OPERATOR_HAND = Topic(
    "operator_hand",
    Header,
    _qos(1, reliable=False),
    "",
    OPERATOR_HEARTBEAT.publishers,
    OPERATOR_NODES,
    f"whose hand sends `{OPERATOR_HEARTBEAT.name}`: `frame_id` is the node. At most 5 Hz; for display only",
    longest_gap=math.inf,
    follows=OPERATOR_HEARTBEAT.name,
    raw=True,
)
OPERATOR_PRESENCE = Topic(
    "operator_presence",
    Header,
    _qos(1),
    "",
    ("operator_watchdog",),
    ("engine_controller", "operator_page"),
    "the operator was seen alive; `stamp` is the source time of that heartbeat. At most 2 Hz by default",
    longest_gap=1.0,
    follows=OPERATOR_HEARTBEAT.name,
)
OPERATOR_ACTIVITY = Topic(
    "operator_activity",
    String,
    _EVENTS,
    "",
    ("operator_watchdog",),
    (*OPERATOR_NODES, FLEET),
    f"`{ALIVE}`, `{MISSED}`, `{INCAPACITATED}`: the watchdog's conclusions, for display only",
    _not_one_of(ALIVE, MISSED, INCAPACITATED),
    longest_gap=math.inf,
)
ENGINES = Topic(
    "engines",
    String,
    _EVENTS,
    "",
    ("operator_watchdog", "dead_mans_switch", *OPERATOR_NODES),
    ("engine_controller", "dead_mans_switch", *OPERATOR_NODES),
    f"command `{TURN_OFF}` or `{TURN_ON}`",
    _not_one_of(TURN_OFF, TURN_ON),
    longest_gap=math.inf,
)
ENGINES_SENDER = Topic(
    "engines/sender",
    KeyValue,
    _EVENTS,
    "",
    ENGINES.publishers,
    ("engine_controller", *OPERATOR_NODES),
    f"who has just sent a command on `{ENGINES.name}`: `key` is the command, `value` the node. For display "
    "only: a command counts without it",
    lambda sender: ENGINES.problem(sender.command) or _not_a_name(sender.node),
    longest_gap=math.inf,
)
ENGINES_STATE = Topic(
    "engines/state",
    String,
    _qos(1, latched=True, lifespan=DRIVE_TIMEOUT),
    "",
    ("engine_controller",),
    ("drive", "dead_mans_switch", *OPERATOR_NODES, FLEET),
    f"`{ON}` or `{OFF}`, on every change and at 10 Hz by default: the drive accepts an `{ON}` for "
    f"{1000 * DRIVE_TIMEOUT:.0f} ms, and for {1000 * DRIVE_TIMEOUT:.0f} ms after an `{OFF}` it accepts none. "
    "So two controllers that disagree move nothing",
    _not_one_of(ON, OFF),
)
ENGINES_CAUSE = Topic(
    "engines/cause",
    DiagnosticArray,
    _STATE,
    "s",
    ("engine_controller",),
    OPERATOR_NODES,
    f"why `{ENGINES_STATE.name}` is as it is, in the words of `message`; `values` name the deciding event, "
    "its sender and age, and why a `turn_on` was refused. Within 0.2 s of each change; for display only",
    cause.problem,
    longest_gap=math.inf,
)
DIAGNOSTICS = Topic(
    "/diagnostics",
    DiagnosticArray,
    _EVENTS,
    "",
    (EVERY_SERVICE,),
    ("engine_controller", "sentinel", *OPERATOR_NODES, FLEET),
    "health, at 1 Hz, and at once to a new subscriber",
    bad_report,
    longest_gap=1.0,
)

ROWS = tuple(each for each in [*globals().values()] if isinstance(each, Topic))
"""All topics above."""
CONTRACT = tuple(topic for topic in ROWS if not isinstance(topic.type, str))
"""Those whose type is installed."""
PARAMETER_CLIENTS = {
    "terminal": (EVERY_SERVICE,),
    "operator_page": ("config_l1", "config_l2", "config_theta1", "config_theta2", "dead_mans_switch"),
}
"""The nodes that read and set parameters of others, and whose."""
CONFIGURATION = {topic.name: topic for topic in (L1, L2, THETA1, THETA2)}
"""The four sources of the manipulator's configuration, by topic name (thesis 5.2.1)."""
JOINTS = (THETA1, THETA2)
"""The part of the configuration that a drive moves."""


def is_latched(qos: QoSProfile) -> bool:
    """Whether a late reader gets what was published before."""
    return bool(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL)


def describe(qos: QoSProfile) -> str:
    """Return a QoS in words."""
    parts = [
        "reliable" if qos.reliability == ReliabilityPolicy.RELIABLE else "best effort",
        "transient local" if is_latched(qos) else "volatile",
        f"last {qos.depth}",
    ]
    if qos.lifespan.nanoseconds:
        parts.append(f"lifespan {qos.lifespan.nanoseconds / 1e6:g} ms")
    return ", ".join(parts)


def markdown() -> str:
    """Return the contract as the table that the README shows."""
    head = "| topic | type | QoS | unit | published by | read by | meaning |"
    lines = [head, "|---|---|---|---|---|---|---|"]
    for topic in ROWS:
        row = (
            f"`{topic.name}`",
            topic.type_name.replace("/msg", ""),
            describe(topic.qos),
            topic.unit,
            ", ".join(topic.publishers),
            ", ".join(topic.subscribers),
            topic.meaning,
        )
        lines.append(f"| {' | '.join(row)} |")
    return "\n".join(lines) + "\n"


def mermaid() -> str:
    """Return the graph of nodes and topics, without health, in the language of Mermaid.

    What a node of the arm reads, the operator sees as well: those arrows are not drawn.
    """
    lines = ["flowchart LR"]
    for topic in ROWS:
        if topic is not DIAGNOSTICS:
            readers = [node for node in topic.subscribers if node not in (*OPERATOR_NODES, FLEET)]
            ends = (" & ".join(topic.publishers), " & ".join(readers or topic.subscribers))
            lines.append(f"    {ends[0]} -- {topic.name} --> {ends[1]}")
    return "\n".join(lines) + "\n"
