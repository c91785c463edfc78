"""Type stubs of message packages, so that editors and mypy know the fields.

``python -m rosidl_runtime_embedded.stubs <package>... --output <directory>`` writes
``<directory>/<package>/msg/__init__.pyi`` and ``…/srv/__init__.pyi``. Those of the packages of this
distribution are committed; for packages of one's own the directory belongs on ``MYPYPATH`` or among the
editor's stub paths.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

from .definition_files import interface_names, message_definition, service_definition
from .fields import ARRAY_CODES, python_value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .definition import Field, MessageDefinition

_PYTHON_TYPES = {
    **{base: "float" if base in ("float", "double") else "int" for base in ARRAY_CODES},
    "boolean": "bool",
    "octet": "bytes",
    "string": "str",
    "wstring": "str",
}
_NUMPY_TYPES = {"float": "float32", "double": "float64"}
_TITLES = {"msg": "Messages", "srv": "Services"}


def _literal(value: object) -> str:
    """A value as source code in the quotes that formatters prefer."""
    text = repr(value)
    return text.replace("'", '"') if isinstance(value, (bytes, str)) and '"' not in text else text


def stub(package: str, kind: str) -> str:
    """Text of the stub of a package's messages (kind ``msg``) or services (``srv``); empty if it has none."""
    classes: list[str] = []
    for name in interface_names(package, kind):
        if kind == "msg":
            classes.append(_message(message_definition(f"{package}/msg/{name}")))
            continue
        service = service_definition(f"{package}/srv/{name}")
        classes += map(_message, (service.request, service.response, service.event))
        parts = (f"    {part}: TypeAlias = {name}_{part}" for part in ("Request", "Response", "Event"))
        classes.append("\n".join([f"class {name}(Service):", *parts]))
    if not classes:
        return ""
    title = f'"""{_TITLES[kind]} of {package}. Made by rosidl_runtime_embedded.stubs."""'
    return "\n\n".join([title, *_imports("\n".join(classes), f"{package}.{kind}"), *classes]) + "\n"


def _imports(body: str, module: str) -> list[str]:
    """Import sections that a stub's classes need."""
    standard = {
        "array[": "from array import array",
        "Iterable[": "from collections.abc import Iterable",
    }
    typing = [name for name in ("Final", "TypeAlias") if f": {name} =" in body]
    others = sorted({other for other in re.findall(r"\b(\w+\.msg)\.", body) if other != module})
    bases = ", ".join(base for base in ("Message", "Service") if f"({base})" in body)
    imports = [line for use, line in standard.items() if use in body]
    if typing:
        imports.append(f"from typing import {', '.join(typing)}")
    sections = [
        imports,
        ["import numpy", "from numpy.typing import NDArray"] if "NDArray[" in body else [],
        [*(f"import {other}" for other in others), f"from rosidl_runtime_embedded import {bases}"],
    ]
    return ["\n".join(lines) for lines in sections if lines]


def _message(definition: MessageDefinition) -> str:
    package, kind, name = definition.name.split("/")
    lines = [f"    {line}" for field in definition.fields for line in _field(field, package, kind)]
    for field in definition.fields:
        if field.default is not None and not field.type.is_plural:
            default = python_value(field.type.base, field.default)
            lines.append(f"    {field.name.upper()}__DEFAULT: Final = {_literal(default)}")
    for constant in definition.constants:
        lines.append(f"    {constant.name}: Final = {_literal(python_value(constant.type, constant.value))}")
    types = {field.name: _accepted(field, package, kind) for field in definition.fields}
    own = "_self" if "self" in types else "self"
    types.setdefault("check_fields", "bool")
    arguments = [f"        {name}: {type_} = ...," for name, type_ in types.items()]
    lines += ["    def __init__(", f"        {own},", "        *,", *arguments, "    ) -> None: ..."]
    return "\n".join([f"class {name}(Message):", *lines])


def _field(field: Field, package: str, kind: str) -> Iterator[str]:
    accepted = _accepted(field, package, kind)
    if not accepted.startswith("Iterable"):
        yield f"{field.name}: {accepted}"
        return
    number, base = _PYTHON_TYPES[field.type.base], field.type.base
    held = f"NDArray[numpy.{_NUMPY_TYPES.get(base, base)}]" if field.type.array_size else f"array[{number}]"
    yield from ("@property", f"def {field.name}(self) -> {held}: ...")
    yield from (f"@{field.name}.setter", f"def {field.name}(self, value: {accepted}) -> None: ...")


def _accepted(field: Field, package: str, kind: str) -> str:
    """Python type that may be assigned to a field."""
    base = field.type.base
    if field.type.is_message:
        other_package, other_kind, name = base.split("/")
        element = (
            name if (other_package, other_kind) == (package, kind) else f"{other_package}.{other_kind}.{name}"
        )
    else:
        element = _PYTHON_TYPES[base]
    if not field.type.is_plural:
        return element
    return f"Iterable[{element}]" if base in ARRAY_CODES else f"list[{element}]"


def write_stubs(package: str, output: Path) -> None:
    """Write the stubs of a package below a directory."""
    for kind in ("msg", "srv"):
        text = stub(package, kind)
        if text:
            path = output / package / kind / "__init__.pyi"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")


def main() -> None:
    """Command line: packages and where to write."""
    parser = argparse.ArgumentParser(description="Write type stubs of message packages.")
    parser.add_argument("packages", nargs="+", metavar="package")
    parser.add_argument("--output", type=Path, required=True, help="directory to write below")
    arguments = parser.parse_args()
    for package in arguments.packages:
        if not (stub(package, "msg") or stub(package, "srv")):
            parser.error(f"there is no message package '{package}' in AMENT_PREFIX_PATH")
        write_stubs(package, arguments.output)


if __name__ == "__main__":
    main()
