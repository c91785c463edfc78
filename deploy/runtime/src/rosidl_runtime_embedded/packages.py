"""Where definitions lie, and how they become importable packages.

A message package is a directory with ``msg/*.msg`` and ``srv/*.srv`` in it. The packages of this distribution
lie beside this one; those of a user in ``<prefix>/share/<package>`` for a prefix of ``AMENT_PREFIX_PATH``.
The former win.
"""

from __future__ import annotations

import os
import re
import sys
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from typing import TYPE_CHECKING, Any, cast

from .definition import InvalidDefinition, MessageDefinition, ServiceDefinition, parse_message, parse_service

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from importlib.abc import Loader
    from types import ModuleType

    from .message import Message
    from .service import Service

_SHIPPED = os.path.dirname(os.path.dirname(__file__))
_KINDS = ["msg", "srv", "action"]
SERVICE_PARTS = ("Request", "Response", "Event")


def _directories(package: str) -> Iterator[str]:
    yield os.path.join(_SHIPPED, package)
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield os.path.join(prefix, "share", package)


def _file(name: str) -> str | None:
    package, kind, type_name = name.split("/")
    paths = (os.path.join(directory, kind, f"{type_name}.{kind}") for directory in _directories(package))
    return next(filter(os.path.isfile, paths), None)


def interface_names(package: str, kind: str) -> list[str]:
    """Names of all messages (kind ``msg``) or services (``srv``) that a package defines, sorted."""
    directories = filter(
        os.path.isdir, (os.path.join(directory, kind) for directory in _directories(package))
    )
    files = {file for directory in directories for file in os.listdir(directory)}
    return sorted(file.removesuffix(f".{kind}") for file in files if file.endswith(f".{kind}"))


def _snake_case(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=.)(?=[A-Z][a-z])", "_", name).lower()


@cache
def definition_source(name: str) -> tuple[str, str]:
    """File and text that define ``<package>/<msg or srv>/<Name>``. Raises LookupError or InvalidDefinition.

    Kept for who asks what a type in use looks like: the file may have changed meanwhile.
    """
    path = _file(name)
    if path is None:
        raise LookupError(f"there is no definition of {name}")
    with open(path, encoding="utf-8") as file:
        try:
            return path, file.read()
        except UnicodeDecodeError as error:
            raise InvalidDefinition(f"{path}:1: the file is not UTF-8: {error}") from None


def _is_defined(name: str) -> bool:
    return _file(name) is not None


@cache
def service_definition(name: str) -> ServiceDefinition:
    """Definition of a service by its full name. Raises LookupError or InvalidDefinition."""
    path, text = definition_source(name)
    return parse_service(name, text, path, _is_defined)


@cache
def message_definition(name: str) -> MessageDefinition:
    """Definition of a message or a service's part by full name. Raises LookupError or InvalidDefinition."""
    if "/srv/" in name:
        service, _, part = name.rpartition("_")
        if part not in SERVICE_PARTS:
            raise LookupError(f"{name} is no message")
        definition: MessageDefinition = getattr(service_definition(service), part.lower())
        return definition
    path, text = definition_source(name)
    return parse_message(name, text, path, _is_defined)


_messages: dict[str, type[Message]] = {}
_services: dict[str, type[Service]] = {}


def message_class(name: str) -> type[Message]:
    """Class of a message or a service's part by full name. Raises LookupError or InvalidDefinition."""
    from .message import make_message_class

    if name not in _messages:
        # setdefault: of two threads that get here at once, both must see one class
        _messages.setdefault(name, make_message_class(message_definition(name)))
    return _messages[name]


def service_class(name: str) -> type[Service]:
    """Class of a service by its full name. Raises LookupError or InvalidDefinition."""
    from .service import make_service_class

    if name not in _services:
        _services.setdefault(name, make_service_class(service_definition(name)))
    return _services[name]


def interfaces(module_name: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """``__getattr__`` and ``__dir__`` of a module ``<package>.msg`` or ``<package>.srv``."""
    package, kind = module_name.split(".")

    def names() -> list[str]:
        names = interface_names(package, kind)
        if kind == "srv":
            names += [f"{name}_{part}" for name in names for part in SERVICE_PARTS]
        return sorted(names)

    def get(name: str) -> Any:
        if name == "__all__":
            return names()
        is_part = kind == "srv" and name.endswith(tuple(f"_{part}" for part in SERVICE_PARTS))
        interface = name.rpartition("_")[0] if is_part else name
        if not _is_defined(f"{package}/{kind}/{interface}"):
            raise AttributeError(f"module '{module_name}' has no attribute '{name}'")
        make = service_class if kind == "srv" and not is_part else message_class
        value = make(f"{package}/{kind}/{name}")
        setattr(sys.modules[module_name], name, value)
        return value

    return get, names


class NoActions(ImportError, NotImplementedError):
    """Actions are not there; who can do without them expects an ImportError."""


class _UserPackages:
    """Meta path finder and loader of the message packages in AMENT_PREFIX_PATH."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Spec of ``<package>``, ``<package>.msg`` and the like, if Python has at most a directory for it.

        Also of ``<package>.msg._pose``, in which ROS 2 has the class Pose: editors import it from there.
        What else it has is passed on: to find that twice would make every import slower.
        """
        package, _, kind = name.partition(".")
        kind, _, module = kind.partition(".")
        if module:
            names = interface_names(package, kind) if kind in _KINDS else []
            known = any(f"_{_snake_case(interface)}" == module for interface in names)
            return ModuleSpec(name, cast("Loader", self)) if known else None
        kinds = [kind] if kind in _KINDS else [] if kind else _KINDS
        if not kinds:
            return None
        found = PathFinder.find_spec(name, path, target)
        if (found and found.loader) or not any(interface_names(package, kind) for kind in kinds):
            return found
        return ModuleSpec(name, cast("Loader", self), origin=f"definitions of {package}", is_package=True)

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave the creation to the import system."""

    def exec_module(self, module: ModuleType) -> None:
        """Give the module its classes."""
        if module.__name__.endswith(".action"):
            raise NoActions(f"{module.__name__}: the embedded runtime has no actions")
        if "." in module.__name__:
            of = ".".join(module.__name__.split(".")[:2])
            vars(module)["__getattr__"], vars(module)["__dir__"] = interfaces(of)


def install() -> None:
    """Make the packages in AMENT_PREFIX_PATH importable, after all that Python finds but mere directories.

    Python's own finder comes later: to it, any directory of a package's name, as that of its sources, is the
    package.
    """
    if not any(isinstance(finder, _UserPackages) for finder in sys.meta_path):
        finders: list[object] = [*sys.meta_path, PathFinder]
        sys.meta_path.insert(finders.index(PathFinder), _UserPackages())
