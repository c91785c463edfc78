"""Service classes, in the shape that ``rosidl_generator_py`` of Jazzy gives them."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from .definition_files import SERVICE_PARTS, service_definition
from .message import Message, message_class

if TYPE_CHECKING:
    from .definition import ServiceDefinition


class _TypeHash:
    def __get__(self, instance: object, owner: type[Service]) -> str:
        from .type_hash import type_hash

        owner._TYPE_HASH = type_hash(owner._TYPE_NAME)
        return owner._TYPE_HASH


class Service:
    """Base of all service classes: three message classes and a name."""

    Request: ClassVar[type[Message]]
    Response: ClassVar[type[Message]]
    Event: ClassVar[type[Message]]
    _TYPE_NAME: ClassVar[str]
    """``std_srvs/srv/Trigger``"""
    _TYPE_HASH: ClassVar[str] = _TypeHash()  # type: ignore[assignment]
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
    """Make the class of a service type."""
    package, kind, name = definition.name.split("/")
    parts = {part: message_class(f"{definition.name}_{part}") for part in SERVICE_PARTS}
    namespace = {
        "__module__": f"{package}.{kind}",
        "__doc__": f"Service {definition.name}.",
        "_TYPE_NAME": definition.name,
    }
    return type(name, (Service,), {**namespace, **parts})
