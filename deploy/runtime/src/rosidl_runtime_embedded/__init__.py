"""Classes, codecs and type hashes of messages and services, made from their definition files."""

from .definition import InvalidDefinition
from .message import Message, message_class
from .packages import install, interfaces
from .service import Service, service_class

install()

__all__ = ["InvalidDefinition", "Message", "Service", "interfaces", "message_class", "service_class"]
