"""Message and service types of the embedded runtime: classes, codecs and hashes from definition files."""

from .definition import InvalidDefinition
from .message import Message
from .packages import install, interfaces, message_class, service_class
from .service import Service

install()

__all__ = ["InvalidDefinition", "Message", "Service", "interfaces", "message_class", "service_class"]
