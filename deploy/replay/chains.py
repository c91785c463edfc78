"""What is replayed: chains of services, the topics that they hear, and the topics that they publish."""

from __future__ import annotations

from rclpy.serialization import deserialize_message

from deploy.chaos.babbler import is_babble
from deploy.replay.record import Message, Record, text
from interfaces.robot_model import BASE, frame_id
from interfaces.topics import (
    CONFIGURATION,
    CONTRACT,
    EFFECTOR_POSITION,
    ENGINES,
    INCAPACITATED,
    OPERATOR_ACTIVITY,
    OPERATOR_HEARTBEAT,
    OPERATOR_PRESENCE,
    TF,
    TURN_OFF,
    Topic,
)

WATCHDOG = OPERATOR_PRESENCE.publishers[0]

HEARD: dict[str, tuple[Topic, ...]] = {
    "kinematics": tuple(CONFIGURATION.values()),
    "velocity": (EFFECTOR_POSITION,),
    WATCHDOG: (OPERATOR_HEARTBEAT,),
    "engine_controller": (ENGINES, OPERATOR_PRESENCE),
    "robot_state": tuple(CONFIGURATION.values()),
}
"""The topics that each replayed service hears."""

Chain = tuple[str, ...]
CHAINS: tuple[Chain, ...] = (
    ("robot_state",),
    ("kinematics",),
    ("velocity",),
    (WATCHDOG, "engine_controller"),
)
"""
Services that hear the replayed output of each other. Chains hear the recorded output of each other.

So velocity hears the recorded positions: its recipe divides by the time between two emissions, of which a
replay of kinematics has others. The slowest chain is the first: chains run in parallel.
"""


def outputs(chain: Chain) -> list[Topic]:
    """Return the topics that the services of a chain publish, without their health."""
    return [topic for topic in CONTRACT if set(topic.publishers) & set(chain)]


def inputs(record: Record, namespace: str, chain: Chain) -> list[tuple[Topic, list[Message]]]:
    """Return the recorded messages that a chain hears, and that none of its services has sent."""
    made = outputs(chain)
    heard = [topic for service in chain for topic in HEARD[service]]
    return [
        (topic, commands(record, namespace)[0] if topic is ENGINES else record.of(topic, namespace))
        for topic in heard
        if topic is ENGINES or topic not in made
    ]


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
    """
    Return the commands of people, and those of the watchdog.

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
    is_away = False
    for message in record.of(ENGINES, namespace):
        while conclusions and conclusions[-1][0] <= message.sent:
            is_away = conclusions.pop()[1] == INCAPACITATED
        of_watchdog = is_away and text(message, ENGINES) == TURN_OFF
        (watchdog if of_watchdog else people).append(message)
    return people, watchdog
