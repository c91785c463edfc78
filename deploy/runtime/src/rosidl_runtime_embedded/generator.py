"""The common part of the generators of serializers and deserializers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from . import generated

if TYPE_CHECKING:
    from collections.abc import Callable

    from .definition import MessageDefinition
    from .layout import Item


class Generator:
    """Writes the code of a function for the messages of one class, and compiles it."""

    def __init__(
        self, definition: MessageDefinition, message_class: Callable[[str], type], **names: object
    ) -> None:
        """``message_class`` returns a class by its full name; ``names`` are globals of the code."""
        self._definition = definition
        self._message_class = message_class
        self._names: dict[str, Any] = {"cls": message_class(definition.name), **names}
        self._lines: list[str] = []
        self._indent = 2
        self._variables = 0
        self._run: list[Item] = []  # values of fixed size for one call of struct
        self._position: int | None = 0  # in the sample; None if known only at run time

    def _emit(self, line: str) -> None:
        self._lines.append(" " * self._indent + line)

    def _name(self, value: object) -> str:
        """Add a value to the globals of the code; return its name."""
        name = f"g{len(self._names)}"
        self._names[name] = value
        return name

    def _variable(self) -> str:
        self._variables += 1
        return f"v{self._variables}"

    def _compiled(self, name: str, code: list[str]) -> Callable[[Any], Any]:
        generated.run("\n".join(code), self._names)
        function: Callable[[Any], Any] = self._names[name]
        function.__qualname__ = f"{self._definition.name.rpartition('/')[2]}._{name}"
        return function
