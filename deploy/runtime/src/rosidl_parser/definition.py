"""Types of fields, as ``SLOT_TYPES`` of a message class names them: those of Jazzy's ``rosidl_parser``."""

from __future__ import annotations

from dataclasses import dataclass


class AbstractType:
    """Any type."""


class AbstractNestableType(AbstractType):
    """A type that can be the element of an array or sequence."""


@dataclass
class BasicType(AbstractNestableType):
    """A number, boolean or octet, by its IDL name."""

    typename: str


@dataclass
class NamespacedType(AbstractNestableType):
    """Another message: its namespaces, such as ``["std_msgs", "msg"]``, and name."""

    namespaces: list[str]
    name: str

    def namespaced_name(self) -> tuple[str, ...]:
        """Namespaces and name."""
        return (*self.namespaces, self.name)


class AbstractGenericString(AbstractNestableType):
    """Text."""

    def has_maximum_size(self) -> bool:
        """Whether its length is bounded."""
        return hasattr(self, "maximum_size")


class AbstractString(AbstractGenericString):
    """Text of characters of 8 bits."""


class AbstractWString(AbstractGenericString):
    """Text of characters of 16 bits."""


@dataclass
class BoundedString(AbstractString):
    """Text of at most so many characters."""

    maximum_size: int


@dataclass
class UnboundedString(AbstractString):
    """Text of any length."""


@dataclass
class BoundedWString(AbstractWString):
    """Text of at most so many wide characters."""

    maximum_size: int


@dataclass
class UnboundedWString(AbstractWString):
    """Text of any number of wide characters."""


@dataclass
class AbstractNestedType(AbstractType):
    """Several elements of one type."""

    value_type: AbstractNestableType

    def has_maximum_size(self) -> bool:
        """Whether their number is bounded."""
        return not isinstance(self, UnboundedSequence)


@dataclass
class Array(AbstractNestedType):
    """A fixed number of elements."""

    size: int


class AbstractSequence(AbstractNestedType):
    """A number of elements that each message has for itself."""


@dataclass
class BoundedSequence(AbstractSequence):
    """At most so many elements."""

    maximum_size: int


@dataclass
class UnboundedSequence(AbstractSequence):
    """Any number of elements."""
