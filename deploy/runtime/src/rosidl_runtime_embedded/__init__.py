"""Message and service types of the embedded runtime: classes, codecs and hashes from definition files."""

from .definition import InvalidDefinition
from .message import Message, message_class
from .packages import install, interfaces
from .service import Service, service_class

install()

__all__ = ["InvalidDefinition", "Message", "Service", "interfaces", "message_class", "service_class"]
