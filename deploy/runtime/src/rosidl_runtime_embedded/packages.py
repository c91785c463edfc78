"""Message packages as importable modules."""

from __future__ import annotations

import re
import sys
from importlib.machinery import ModuleSpec, PathFinder
from typing import TYPE_CHECKING, Any, cast

from .definition_files import SERVICE_PARTS, interface_names, is_defined
from .message import message_class
from .service import service_class

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from importlib.abc import Loader
    from types import ModuleType

_KINDS = ["msg", "srv", "action"]


def _snake_case(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=.)(?=[A-Z][a-z])", "_", name).lower()


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
        if not is_defined(f"{package}/{kind}/{interface}"):
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
