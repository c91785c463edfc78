"""Makes the class of a message, service or action with the name, module and metaclass that ROS 2 gives it.

Programs read them: rosbridge_suite learns the type from the text ``<class 'std_msgs.msg._string.String'>``.
"""

from __future__ import annotations

import re
from typing import Any, ClassVar, TypeVar

_Base = TypeVar("_Base")


def module_of(name: str) -> str:
    """The module of ROS 2 that defines the class of ``std_msgs/msg/String``: ``std_msgs.msg._string``."""
    package, kind, interface = name.split("/")
    interface, _, _ = interface.partition("_")  # the parts of a service or action are in its module
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=.)(?=[A-Z][a-z])", "_", interface)
    return f"{package}.{kind}._{words.lower()}"


class InterfaceType(type):
    """Base of the metaclasses: each interface has its own, as in ROS 2."""

    _TYPE_SUPPORT: ClassVar[str]
    """In ROS 2 a structure of C, or None before its import. Here the name of the type: there is no C."""

    @classmethod
    def __import_type_support__(cls) -> None:
        """Do nothing: there is nothing to import."""


def make_class(
    base: type[_Base], name: str, namespace: dict[str, Any], constants: dict[str, Any] | None = None
) -> type[_Base]:
    """Make the class of an interface, derived from ``base``.

    :param name: such as ``std_msgs/msg/String``.
    :param namespace: the members of the class.
    :param constants: members that cannot be set.
    """
    module, class_name = module_of(name), name.rpartition("/")[2]
    constants = constants or {}
    metaclass = type(
        f"Metaclass_{class_name}",
        (InterfaceType,),
        {
            "__module__": module,
            "_TYPE_SUPPORT": name,
            **{constant: _constant(value) for constant, value in constants.items()},
        },
    )
    # Instances do not see the properties of the metaclass, so the class has the constants as well.
    members = {"__module__": module, "_TYPE_NAME": name, **namespace, **constants}
    cls: type[_Base] = metaclass(class_name, (base,), members)
    return cls


def _constant(value: Any) -> property:
    return property(lambda cls: value)
