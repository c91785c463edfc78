"""Writes type stubs of message packages for `make check`: the classes of rosidl have no annotations.

python -m deploy.commands.stubs DIRECTORY
"""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

PACKAGES = (
    "action_msgs",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "lifecycle_msgs",
    "rcl_interfaces",
    "rosgraph_msgs",
    "sensor_msgs",
    "service_msgs",
    "std_msgs",
    "std_srvs",
    "type_description_interfaces",
    "unique_identifier_msgs",
)
KINDS = ("msg", "srv", "action")
_NUMBERS = {"float": "float", "double": "float", "boolean": "bool"} | {
    f"{sign}int{bits}": "int" for sign in ("", "u") for bits in (8, 16, 32, 64)
}
_SEQUENCE = re.compile(r"sequence<(.*?)(?:, \d+)?>|(.*)\[\d+\]")
_PARTS = ("Request", "Response", "Event", "Goal", "Result", "Feedback")


def main(directory: Path) -> None:
    for package in PACKAGES:
        for kind in KINDS:
            try:
                module = importlib.import_module(f"{package}.{kind}")
            except ModuleNotFoundError:
                continue
            file = directory / package / kind / "__init__.pyi"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text("\n".join(stub(module)) + "\n")
            file.parents[1].joinpath("__init__.pyi").touch()


def stub(module: ModuleType) -> Iterator[str]:
    """Yield the lines of a stub of all messages, services or actions of a package."""
    classes = [each for name, each in sorted(vars(module).items()) if isinstance(each, type)]
    lines = [line for each in classes for line in _class(each)]
    yield "from array import array"
    yield "from collections.abc import Iterable"
    yield "from typing import Any"
    for name in sorted(set(re.findall(r"\b(\w+\.(?:msg|srv|action))\.", " ".join(lines)))):
        yield f"import {name}"
    yield from lines


def _class(message: Any) -> Iterator[str]:
    yield f"class {message.__name__}:"
    if not hasattr(message, "get_fields_and_field_types"):  # a service or an action
        yield "    Impl: Any"
        for part in _PARTS:
            if (found := getattr(message, part, None)) is not None:
                yield f"    {part} = {found.__name__}"
        return
    fields = {name: _types(text) for name, text in message.get_fields_and_field_types().items()}
    for name in getattr(type(message), "_Metaclass_" + message.__name__ + "__constants", {}):
        yield f"    {name}: {type(getattr(message, name)).__name__}"
    for name, (read, written) in fields.items():
        if read == written:
            yield f"    {name}: {read}"
        else:
            yield f"    @property\n    def {name}(self) -> {read}: ..."
            yield f"    @{name}.setter\n    def {name}(self, value: {written}) -> None: ..."
    arguments = [f"{name}: {written} = ..." for name, (_, written) in fields.items()]
    yield f"    def __init__(self, *, {', '.join([*arguments, 'check_fields: bool = ...'])}) -> None: ..."
    yield "    @classmethod\n    def get_fields_and_field_types(cls) -> dict[str, str]: ..."


def _types(text: str) -> tuple[str, str]:
    """Return the types that a field has and takes, from the text of its type."""
    if match := _SEQUENCE.fullmatch(text):
        of_sequence, of_array = match.groups()
        item = _type(of_sequence or of_array)
        if (of_sequence or of_array) not in _NUMBERS or item == "bool":
            return f"list[{item}]", f"list[{item}]"
        return (f"array[{item}]" if of_sequence else "Any"), f"Iterable[{item}]"
    return _type(text), _type(text)


def _type(text: str) -> str:
    if "/" in text:
        package, _, name = text.partition("/")
        kind = "srv" if re.search("_(Request|Response|Event)$", name) else "msg"
        return f"{package}.{kind}.{name}"
    if text.startswith(("string", "wstring")):
        return "str"
    return _NUMBERS.get(text, "bytes")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
