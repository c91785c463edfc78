"""Type descriptions and RIHS01 type hashes (REP 2011, REP 2016)."""

from __future__ import annotations

import json
from hashlib import sha256
from typing import TYPE_CHECKING, Any

from .definition import Field, FieldType, MessageDefinition
from .packages import SERVICE_PARTS, definition_source, message_class, message_definition, service_definition

if TYPE_CHECKING:
    from .message import Message

# numbers of type_description_interfaces/msg/FieldType
_TYPE_IDS = {
    "int8": 2,
    "uint8": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float": 10,
    "double": 11,
    "boolean": 15,
    "octet": 16,
    "string": 17,
    "wstring": 18,
}
_NESTED, _BOUNDED_TEXT, _ARRAY, _BOUNDED_SEQUENCE, _SEQUENCE = 1, 4, 48, 96, 144


def _is_part(name: str) -> bool:
    return "/srv/" in name and name.rpartition("_")[2] in SERVICE_PARTS


def _individual(name: str) -> MessageDefinition:
    """A type as a struct; that of a service has its three messages as members."""
    if "/srv/" not in name or _is_part(name):
        return message_definition(name)
    service = service_definition(name)
    parts = {"request": service.request, "response": service.response, "event": service.event}
    fields = (Field(f"{part}_message", FieldType(message.name)) for part, message in parts.items())
    return MessageDefinition(name, tuple(fields))


def _field_type(type_: FieldType) -> dict[str, Any]:
    type_id = (
        _NESTED if type_.is_message else _TYPE_IDS[type_.base] + (_BOUNDED_TEXT if type_.string_bound else 0)
    )
    if type_.array_size:
        type_id += _ARRAY
    elif type_.is_sequence:
        type_id += _BOUNDED_SEQUENCE if type_.sequence_bound else _SEQUENCE
    return {
        "type_id": type_id,
        "capacity": type_.array_size or type_.sequence_bound,
        "string_capacity": type_.string_bound,
        "nested_type_name": type_.base if type_.is_message else "",
    }


def _describe(name: str) -> dict[str, Any]:
    fields = [
        {
            "name": field.name,
            "type": _field_type(field.type),
            "default_value": "" if field.default is None else str(field.default),
        }
        for field in _individual(name).members
    ]
    return {"type_name": name, "fields": fields}


def _describe_all(name: str) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Description of a type, and those of all types in it, sorted by name."""
    found: dict[str, dict[str, Any]] = {}
    waiting = [name]
    while waiting:
        current = waiting.pop()
        if current not in found:
            found[current] = _describe(current)
            nested = (field["type"]["nested_type_name"] for field in found[current]["fields"])
            waiting += filter(None, nested)
    description = found.pop(name)
    return description, [found[key] for key in sorted(found)]


def type_hash(name: str) -> str:
    """RIHS01 hash of a message or service by full name: SHA-256 of its description in JSON, no defaults."""
    description, referenced = _describe_all(name)
    for struct in (description, *referenced):
        for field in struct["fields"]:
            del field["default_value"]
    text = json.dumps({"type_description": description, "referenced_type_descriptions": referenced})
    return f"RIHS01_{sha256(text.encode()).hexdigest()}"


def type_description(name: str) -> Message:
    """``type_description_interfaces/msg/TypeDescription`` of a message or service by its full name."""
    description, referenced = _describe_all(name)
    return _to_message(
        "TypeDescription", {"type_description": description, "referenced_type_descriptions": referenced}
    )


def type_sources(description: Any) -> list[Message]:
    """``type_description_interfaces/msg/TypeSource`` of what a ``TypeDescription`` describes, in its order.

    A service's parts have no definition of their own: theirs is empty, its encoding ``implicit`` (as in rcl).
    """
    individual = [description.type_description, *description.referenced_type_descriptions]
    return [_to_message("TypeSource", _source(one.type_name)) for one in individual]


def _source(name: str) -> dict[str, str]:
    if _is_part(name):
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
