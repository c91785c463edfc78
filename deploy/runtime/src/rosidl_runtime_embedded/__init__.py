"""Classes, codecs and type hashes of messages, services and actions, made from their definition files."""

from .action import Action, action_class
from .definition import InvalidDefinition
from .message import Message, message_class
from .packages import install, kinds
from .service import Service, service_class

install()

__all__ = [
    "Action",
    "InvalidDefinition",
    "Message",
    "Service",
    "action_class",
    "kinds",
    "message_class",
    "service_class",
]
