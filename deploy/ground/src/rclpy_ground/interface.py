"""The interface to a ground: what the substitute needs of what lies below it.

A ground has a network of participants, conditions, and wait sets. It moves octets (CDR with an encapsulation
header) from writers to readers, matches them by topic, type name and QoS, and knows what it has discovered.
It knows no message, node, service or timer: the substitute makes these. All durations are integers [ns].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:  # not at run time: the ground is chosen before rclpy is imported
    from rclpy.qos import QoSProfile

INFINITY = 2**63 - 1
"""A duration that never ends [ns]."""

Handle = Any
"""A condition, as a wait set of the same ground takes it."""


class Sample(NamedTuple):
    """A received message."""

    data: bytes
    """CDR with its encapsulation header."""
    source_timestamp: int
    """When it was written, by the writer's time of day [ns since 1970]."""
    publication_handle: int
    """The ``instance_handle`` of its writer, as the reader's participant knows it."""


class NodeName(NamedTuple):
    namespace: str
    name: str
    number: str
    """Distinguishes nodes of one name in a participant."""


@dataclass(frozen=True)
class Endpoint:
    """A writer or reader that was discovered."""

    gid: bytes
    """Its GUID (RTPS 2.5, 9.3.1)."""
    participant: bytes
    """The GUID of its participant."""
    topic: str
    """As DDS names it, for example ``rt/chatter``."""
    type_name: str
    """As DDS names it, for example ``std_msgs::msg::dds_::String_``."""
    user_data: str
    """Its USER_DATA: ``key=value;`` pairs, such as ``typehash=RIHS01_…;``."""
    profile: QoSProfile
    """The policies that it announces; none is left to a default."""
    node: NodeName | None = None
    """Its node, if the ground knows it by other means than ``node=`` in the USER_DATA."""


class Discovery(Protocol):
    """What a participant has discovered, its own entities included."""

    def participants(self) -> dict[bytes, str]:
        """Return the USER_DATA of every participant by its GUID."""
        ...

    def writers(self) -> list[Endpoint]: ...

    def readers(self) -> list[Endpoint]: ...


class EndpointOfGround(Protocol):
    """What writers and readers have in common. Its statuses are those of DDS 1.4, 2.2.4.1, in lower case."""

    instance_handle: int
    """The number by which samples name a writer; the same in all processes that know it."""
    handle: Handle
    """The condition that is true while a status that is watched has changed."""

    def watch(self, names: list[str]) -> None:
        """Trigger the condition for these statuses, and for no others."""
        ...

    def watch_also(self, name: str) -> None: ...

    def changed(self, name: str) -> dict[str, int] | None:
        """Return the fields of a status if it has changed since the last call."""
        ...

    def matched(self) -> int:
        """Return the number of endpoints that it is matched with."""
        ...

    def matched_user_data(self) -> list[str]: ...

    def close(self) -> None: ...


class Writer(EndpointOfGround, Protocol):
    def write(self, data: bytes, *, is_request: bool = False) -> None:
        """Write a message. A request keeps other Python threads waiting until this returns."""
        ...

    def wait_for_acks(self, timeout: int) -> bool:
        """Wait until all reliable readers have all samples, at most ``timeout`` [ns]; whether they do."""
        ...

    def assert_liveliness(self) -> None: ...


class Reader(EndpointOfGround, Protocol):
    condition: Handle
    """The condition that is true while there are samples to take."""

    def take(self) -> Sample | None: ...

    def user_data_of(self, publication_handle: int) -> str | None:
        """Return the USER_DATA of a matched writer, ``None`` if it is no longer matched."""
        ...


class Participant(Protocol):
    """A participant of DDS: one for each context that has nodes."""

    gid: bytes

    def create_writer(self, topic: str, type_name: str, profile: QoSProfile, user_data: str) -> Writer: ...

    def create_reader(self, topic: str, type_name: str, profile: QoSProfile, user_data: str) -> Reader: ...

    def create_discovery(self) -> Discovery:
        """Return what shows the entities that it knows; the same object each time."""
        ...

    def close(self) -> None: ...


class GuardCondition(Protocol):
    """A condition that the program triggers."""

    handle: Handle

    def trigger(self) -> None: ...

    def take(self) -> object:
        """Make it false again."""
        ...

    def close(self) -> None: ...


class WaitSet(Protocol):
    """Waits for conditions. One thread at a time uses it."""

    def attach(self, handle: Handle, token: int) -> object:
        """Add a condition, which :meth:`wait` reports as ``token``."""
        ...

    def detach(self, handle: Handle) -> None: ...

    def wait(self, timeout: int) -> list[int]:
        """Wait until a condition is true, at most ``timeout`` [ns]; return the tokens of all true ones."""
        ...

    def close(self) -> None: ...


class Ground(Protocol):
    """What lies below rclpy: it is chosen before rclpy is imported, for the life of the interpreter."""

    name: str
    """What ``rclpy.utilities.get_rmw_implementation_identifier`` returns."""
    has_processes: bool
    """Whether this interpreter runs many processes, each thread until it waits, as in virtual time. Then each
    process has its own log levels and standard error."""

    def check(self, domain_id: int, enclave: str) -> None:
        """Raise RCLError if no participant can join: ask before rcl reads the same environment."""
        ...

    def create_participant(self, domain_id: int, enclave: str) -> Participant: ...

    def create_guard_condition(self) -> GuardCondition: ...

    def create_wait_set(self) -> WaitSet: ...

    def watch_signals(self) -> None:
        """Begin to end the waits at each signal, so that Python can run its handler."""
        ...

    def note_poll(self) -> None:
        """Note that a program asks without waiting: virtual time must pass in a loop that only asks."""
        ...


def check(profile: QoSProfile) -> None:
    """Raise RCLError for a profile that no endpoint can have."""
    from rclpy_ground.genuine import RCLError

    for name in ("history", "reliability", "durability", "liveliness"):
        if getattr(profile, name).name == "UNKNOWN":
            raise RCLError(f"the {name} of an endpoint cannot be UNKNOWN")


def nanoseconds(duration: Any) -> int:
    """Return a duration of a QoS profile [ns]; none and an endless one are :data:`INFINITY`."""
    value: int = duration.nanoseconds
    return value if 0 < value < INFINITY else INFINITY


def user_data_value(data: str, key: str) -> str:
    """Return a value of USER_DATA; '' if it has none of this key."""
    for entry in data.split(";"):
        name, _, value = entry.partition("=")
        if name == key:
            return value
    return ""
