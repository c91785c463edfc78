"""Type descriptions and sources as messages, for the service ``get_type_description`` (REP 2016)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .definition_files import definition_source
from .message import message_class
from .type_hash import describe, is_part

if TYPE_CHECKING:
    from .message import Message


def type_description(name: str) -> Message:
    description, referenced = describe(name)
    return _to_message(
        "TypeDescription", {"type_description": description, "referenced_type_descriptions": referenced}
    )


def type_sources(description: Any) -> list[Message]:
    """``type_description_interfaces/msg/TypeSource`` of every type in a ``TypeDescription``, in its order.

    The parts of a service or action have no definition file: their source is empty, with the encoding
    ``implicit``, as in rcl.
    """
    individual = [description.type_description, *description.referenced_type_descriptions]
    return [_to_message("TypeSource", _source(each.type_name)) for each in individual]


def _source(name: str) -> dict[str, str]:
    if is_part(name):
        return {"type_name": name, "encoding": "implicit"}
    path, contents = definition_source(name)
    return {"type_name": name, "encoding": path.rpartition(".")[2], "raw_file_contents": contents}


def _to_message(type_name: str, values: dict[str, Any]) -> Message:
    cls = message_class(f"type_description_interfaces/msg/{type_name}")
    fields = cls.get_fields_and_field_types()
    arguments = {}
    for name, value in values.items():
        nested = fields[name].removeprefix("sequence<").removesuffix(">").rpartition("/")[2]
        if isinstance(value, dict):
            value = _to_message(nested, value)
        elif isinstance(value, list):
            value = [_to_message(nested, element) for element in value]
        arguments[name] = value
    return cls(**arguments)
