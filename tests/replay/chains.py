"""What is replayed: chains of services, the topics that they hear, and the topics that they publish."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import deserialize_message, serialize_message
from rclpy_simulation.host import SECOND
from std_msgs.msg import Header, String

from interfaces.robot_model import BASE, frame_id
from interfaces.service.health import reported_refusals
from interfaces.topics import (
    CONFIGURATION,
    CONTRACT,
    EFFECTOR_SPEED,
    ENGINES,
    ENGINES_STATE,
    INCAPACITATED,
    ON,
    OPERATOR_ACTIVITY,
    OPERATOR_HEARTBEAT,
    OPERATOR_PRESENCE,
    TF,
    TURN_OFF,
    TURN_ON,
    Topic,
    is_latched,
)
from tests.promises.history import CONTROLLER, WATCHDOG
from tests.promises.marks import is_babble
from tests.promises.observations import time_sent
from tests.replay.lives import Latch, begins_away, latch, lives, read_reports
from tests.replay.record import Message, Record, text

Chain = tuple[str, ...]
CHAINS: tuple[Chain, ...] = (
    ("robot_state",),
    ("kinematics",),
    ("velocity",),
    ("twist",),
    (WATCHDOG, CONTROLLER),
)
"""Services that hear the replayed output of each other. Chains hear the recorded output of each other.

So velocity hears the recorded positions: its recipe divides by the time between two emissions, which a
replay of kinematics changes. The slowest chain is the first: chains run in parallel.
"""


def outputs(chain: Chain) -> list[Topic]:
    """Return the topics that the services of a chain publish, without their health."""
    return [topic for topic in CONTRACT if set(topic.publishers) & set(chain)]


def inputs(record: Record, namespace: str, chain: Chain) -> list[tuple[Topic, list[Message]]]:
    """Return the recorded messages that a chain hears, and that none of its services has sent.

    Of those that were sent before the arm began, it hears the latched ones. A sample that was too late for a
    signal has the time from which its value counted, or is left out.
    """
    made = outputs(chain)
    found = []
    for topic in (each for each in CONTRACT if set(each.subscribers) & set(chain)):
        if topic is ENGINES or topic not in made:
            sent = commands(record, namespace)[0] if topic is ENGINES else record.of(topic, namespace)
            heard = [each for each in sent if each.sent >= record.begin or is_latched(topic.qos)]
            found.append((topic, as_taken(heard, refusals(record, namespace, chain, topic))))
    return found


def refusals(record: Record, namespace: str, chain: Chain, topic: Topic) -> dict[int, list[int | None]]:
    """Return when the samples that the signals of a chain refused were sent, and from when they counted."""
    found: dict[int, list[int | None]] = {}

    def note(reported: int, status: DiagnosticStatus) -> None:
        for stamps in reported_refusals(status, topic.name):
            sent, taken = (
                None if stamp is None else int(time_sent(reported, stamp, record.offsets, SECOND))
                for stamp in stamps
            )
            if sent is not None:
                found.setdefault(sent, []).append(taken)

    for service in chain:
        read_reports(record, namespace, service, note)
    return found


def as_taken(messages: list[Message], refused: dict[int, list[int | None]]) -> list[Message]:
    """Return messages as signals took them; of two with one time, the later one was refused."""
    found = []
    for message in reversed(messages):
        taken = refused[message.sent].pop() if refused.get(message.sent) else message.sent
        if taken is not None:
            found.append(message._replace(sent=taken))
    found.reverse()
    return sorted(found, key=lambda message: message.sent)


def has_input(record: Record, namespace: str, chain: Chain) -> bool:
    """Return whether a record contains what a chain hears; a watchdog alone hears an operator who is away."""
    if WATCHDOG in chain and record.of(OPERATOR_ACTIVITY, namespace):
        return True
    return any(messages for _, messages in inputs(record, namespace, chain))


def past(record: Record, namespace: str, chain: Chain) -> list[tuple[Topic, list[Message]]]:
    """Return made-up messages that bring the controller of a chain into the state that the record shows."""
    shown = first_latch(record, namespace) if CONTROLLER in chain else None
    if shown is None or not shown.operator_is_present:
        return []
    presence = Message(
        shown.known,
        serialize_message(Header(stamp=Time(sec=shown.known // SECOND, nanosec=shown.known % SECOND))),
    )
    turn_on = Message(shown.known + SECOND // 100, serialize_message(String(data=TURN_ON)))
    return [(OPERATOR_PRESENCE, [presence]), (ENGINES, [turn_on] if shown.engines == ON else [])]


def first_latch(record: Record, namespace: str) -> Latch | None:
    """Return what the record shows first of the latch of the arm in a namespace."""
    return latch(record, namespace, lives(record, namespace, CONTROLLER)[0])


def known(record: Record, namespace: str, topic: Topic) -> int:
    """Return from when on the record shows what an output depends on [ns since 1970]; else its end.

    The strikes are known from the beginning: what comes later shows them.
    """
    if topic is EFFECTOR_SPEED:  # a speed that equals the last one is not published
        shown = [record.of(topic, namespace)]
    elif topic is ENGINES_STATE:
        first = first_latch(record, namespace)
        return record.end if first is None else first.known
    elif WATCHDOG in topic.publishers:
        # While the operator is away, there is neither. A presence shows that heartbeats were not recorded.
        is_unknown = record.of(OPERATOR_PRESENCE, namespace) and not record.of(OPERATOR_HEARTBEAT, namespace)
        return record.end if is_unknown else record.begin
    else:
        shown = [record.of(each, namespace) for each in CONFIGURATION.values()]
    return max((each[0].sent if each else record.end for each in shown), default=record.begin)


def recorded(record: Record, namespace: str, topic: Topic) -> list[Message]:
    """Return what the services of an arm have published on a topic, without what the chaos monkey has."""
    sent = commands(record, namespace)[1] if topic is ENGINES else record.of(topic, namespace)
    if topic is TF:  # all arms share it
        sent = [message for message in sent if _is_of_arm(message, namespace)]
    return [message for message in sent if not is_babble(topic, message.data)]


def _is_of_arm(message: Message, namespace: str) -> bool:
    """Return whether transforms are of the frames of the arm in a namespace."""
    try:
        found = deserialize_message(message.data, TF.type).transforms
    except Exception:  # of any type, by the runtime
        return False
    return any(each.header.frame_id == frame_id(BASE, namespace) for each in found)


def commands(record: Record, namespace: str) -> tuple[list[Message], list[Message]]:
    """Return the commands of people, and those of the watchdog.

    A record does not name publishers. The watchdog sends ``turn_off`` after its conclusion that the operator
    is incapacitated, until its next conclusion.
    """
    people: list[Message] = []
    watchdog: list[Message] = []
    conclusions = [
        (message.sent, text(message, OPERATOR_ACTIVITY))
        for message in record.of(OPERATOR_ACTIVITY, namespace)
    ]
    conclusions.reverse()
    is_away = begins_away(record, namespace, lives(record, namespace, WATCHDOG)[0])
    for message in record.of(ENGINES, namespace):
        while conclusions and conclusions[-1][0] <= message.sent:
            is_away = conclusions.pop()[1] == INCAPACITATED
        of_watchdog = is_away and text(message, ENGINES) == TURN_OFF
        (watchdog if of_watchdog else people).append(message)
    return people, watchdog
