"""Service classes with the interface of those that Jazzy's ``rosidl_generator_py`` generates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from .definition_files import SERVICE_PARTS, service_definition
from .interface_class import make_class
from .message import Message, message_class

if TYPE_CHECKING:
    from .definition import ServiceDefinition


class InterfaceTypeHash:
    """The type hash of a class of services or actions, which is computed on its first use."""

    def __get__(self, instance: object, owner: Any) -> str:
        from .type_hash import type_hash

        computed = type_hash(owner._TYPE_NAME)
        owner._TYPE_HASH = computed
        return computed


class Service:
    """Base of all service classes: three message classes and a name."""

    Request: ClassVar[type[Message]]
    Response: ClassVar[type[Message]]
    Event: ClassVar[type[Message]]
    _TYPE_NAME: ClassVar[str]
    """``std_srvs/srv/Trigger``"""
    _TYPE_HASH: ClassVar[str] = InterfaceTypeHash()  # type: ignore[assignment]
    """``RIHS01_…``"""

    def __init__(self) -> None:
        raise NotImplementedError("Service classes can not be instantiated")


_classes: dict[str, type[Service]] = {}


def service_class(name: str) -> type[Service]:
    """Class of a service by its full name. Raises LookupError or InvalidDefinition."""
    if name not in _classes:
        _classes.setdefault(name, _make_service_class(service_definition(name)))
    return _classes[name]


def _make_service_class(definition: ServiceDefinition) -> type[Service]:
    parts = {part: message_class(f"{definition.name}_{part}") for part in SERVICE_PARTS}
    return make_class(Service, definition.name, {"__doc__": f"Service {definition.name}.", **parts})
