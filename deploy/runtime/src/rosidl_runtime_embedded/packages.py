"""Makes message packages importable as modules."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from typing import TYPE_CHECKING, Any, cast

from .action import action_class
from .definition_files import ACTION_PARTS, ACTION_SERVICES, KINDS, SERVICE_PARTS, interface_names, is_defined
from .interface_class import module_of
from .message import message_class
from .service import service_class

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from importlib.abc import Loader
    from types import ModuleType

_PARTS: dict[str, tuple[str, ...]] = {"msg": (), "srv": SERVICE_PARTS, "action": ACTION_PARTS}
"""Suffixes of the messages that an interface of each kind defines."""


def _interfaces(module_name: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """The functions ``__getattr__`` and ``__dir__`` of a module ``<package>.<msg, srv or action>``."""
    package, kind = module_name.split(".")

    def names() -> list[str]:
        names = interface_names(package, kind)
        return sorted([*names, *(f"{name}_{part}" for name in names for part in _PARTS[kind])])

    def get(name: str) -> Any:
        if name == "__all__":
            return names()
        interface, _, part = name.partition("_")
        known = not part or part in _PARTS[kind] or (kind == "action" and part in ACTION_SERVICES)
        if not known or not is_defined(f"{package}/{kind}/{interface}"):
            raise AttributeError(f"module '{module_name}' has no attribute '{name}'")
        value = _make(kind, part)(f"{package}/{kind}/{name}")
        setattr(sys.modules[module_name], name, value)
        return value

    return get, names


def kinds(package: str) -> Callable[[str], Any]:
    """The function ``__getattr__`` of a package: it imports ``msg``, ``srv`` or ``action`` on first use.

    In ROS 2, a class in use has mostly imported them before, so programs write ``import std_msgs`` only.
    """

    def get(name: str) -> Any:
        if name in KINDS and interface_names(package, name):
            return import_module(f"{package}.{name}")
        raise AttributeError(f"module '{package}' has no attribute '{name}'")

    return get


def _one_interface(module_name: str) -> Callable[[str], Any]:
    """The function ``__getattr__`` of the module of an interface: its classes, and their metaclasses."""
    parent = module_name.rpartition(".")[0]

    def get(name: str) -> Any:
        class_name = name.removeprefix("Metaclass_")
        if module_of(f"{parent.replace('.', '/')}/{class_name}") != module_name:
            raise AttributeError(f"module '{module_name}' has no attribute '{name}'")
        cls = getattr(sys.modules[parent], class_name)
        return cls if name == class_name else type(cls)

    return get


def _make(kind: str, part: str) -> Callable[[str], Any]:
    """The function that makes the class of an interface, or of a part of it."""
    if part in ACTION_SERVICES or (kind == "srv" and not part):
        return service_class
    return action_class if kind == "action" and not part else message_class


class _MessagePackages:
    """Meta path finder and loader of packages in AMENT_PREFIX_PATH, and of the modules of our packages."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Spec of ``<package>``, ``<package>.msg`` and so on, unless Python finds more than a directory.

        Also of ``<package>.msg._pose``, the module of the class Pose in ROS 2, from which editors import it.
        A spec that Python finds is returned, because a second search would slow every import down.
        """
        package, _, kind = name.partition(".")
        kind, _, module = kind.partition(".")
        if module:
            if kind in KINDS and (found := PathFinder.find_spec(name, path, target)):
                return found  # of a ROS 2 that is sourced as well
            names = interface_names(package, kind) if kind in KINDS else []
            known = any(module_of(f"{package}/{kind}/{interface}") == name for interface in names)
            return ModuleSpec(name, cast("Loader", self)) if known else None
        kinds = [kind] if kind in KINDS else [] if kind else list(KINDS)
        if not kinds:
            return None
        found = PathFinder.find_spec(name, path, target)
        if (found and found.loader) or not any(interface_names(package, kind) for kind in kinds):
            return found
        return ModuleSpec(name, cast("Loader", self), origin=f"definitions of {package}", is_package=True)

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave the creation to the import system."""

    def exec_module(self, module: ModuleType) -> None:
        name, members = module.__name__, vars(module)
        match name.count("."):
            case 0:
                members["__getattr__"] = kinds(name)
            case 1:
                members["__getattr__"], members["__dir__"] = _interfaces(name)
            case _:
                members["__getattr__"] = _one_interface(name)


def install() -> None:
    """Make message packages importable, unless Python finds a module of that name.

    This finder goes before Python's, which would take any directory with the name of the package, such as
    that of its sources, for the package.
    """
    if not any(isinstance(finder, _MessagePackages) for finder in sys.meta_path):
        finders: list[object] = [*sys.meta_path, PathFinder]
        sys.meta_path.insert(finders.index(PathFinder), _MessagePackages())
