"""The types in ``SLOT_TYPES`` of a message class, as in Jazzy's ``rosidl_parser``."""

from __future__ import annotations

from dataclasses import dataclass


class AbstractType:
    """Any type."""


class AbstractNestableType(AbstractType):
    """A type that can be the element of an array or sequence."""


@dataclass
class BasicType(AbstractNestableType):
    """A number, boolean or octet, with its IDL name."""

    typename: str


@dataclass
class NamespacedType(AbstractNestableType):
    """A message, with its namespaces, such as ``["std_msgs", "msg"]``, and name."""

    namespaces: list[str]
    name: str

    def namespaced_name(self) -> tuple[str, ...]:
        return (*self.namespaces, self.name)


class AbstractGenericString(AbstractNestableType):
    def has_maximum_size(self) -> bool:
        return hasattr(self, "maximum_size")


class AbstractString(AbstractGenericString):
    """A string of 8-bit characters."""


class AbstractWString(AbstractGenericString):
    """A string of 16-bit characters."""


@dataclass
class BoundedString(AbstractString):
    """A string with a maximum number of characters."""

    maximum_size: int


@dataclass
class UnboundedString(AbstractString):
    """A string of any length."""


@dataclass
class BoundedWString(AbstractWString):
    """A wide string with a maximum number of characters."""

    maximum_size: int


@dataclass
class UnboundedWString(AbstractWString):
    """A wide string of any length."""


@dataclass
class AbstractNestedType(AbstractType):
    value_type: AbstractNestableType

    def has_maximum_size(self) -> bool:
        """Whether the number of elements is bounded."""
        return not isinstance(self, UnboundedSequence)


@dataclass
class Array(AbstractNestedType):
    size: int


class AbstractSequence(AbstractNestedType):
    """A number of elements that may differ between messages."""


@dataclass
class BoundedSequence(AbstractSequence):
    """A sequence with a maximum number of elements."""

    maximum_size: int


@dataclass
class UnboundedSequence(AbstractSequence):
    """A sequence of any length."""
