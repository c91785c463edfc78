"""RIHS01 type hashes, and the type descriptions that they are made from (REP 2011, REP 2016)."""

from __future__ import annotations

import json
from hashlib import sha256
from typing import Any

from .definition import Field, FieldType, MessageDefinition
from .definition_files import SERVICE_PARTS, message_definition, service_definition

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


def is_part(name: str) -> bool:
    """Whether a full name is that of a service's request, response or event."""
    return "/srv/" in name and name.rpartition("_")[2] in SERVICE_PARTS


def _individual(name: str) -> MessageDefinition:
    """A type as a struct; that of a service has its three messages as members."""
    if "/srv/" not in name or is_part(name):
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


def _individual_description(name: str) -> dict[str, Any]:
    fields = [
        {
            "name": field.name,
            "type": _field_type(field.type),
            "default_value": "" if field.default is None else str(field.default),
        }
        for field in _individual(name).members
    ]
    return {"type_name": name, "fields": fields}


def describe(name: str) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Description of a type, and those of all types in it, sorted by name."""
    found: dict[str, dict[str, Any]] = {}
    waiting = [name]
    while waiting:
        current = waiting.pop()
        if current not in found:
            found[current] = _individual_description(current)
            nested = (field["type"]["nested_type_name"] for field in found[current]["fields"])
            waiting += filter(None, nested)
    description = found.pop(name)
    return description, [found[key] for key in sorted(found)]


def type_hash(name: str) -> str:
    """RIHS01 hash of a message or service by full name: SHA-256 of its description in JSON, no defaults."""
    description, referenced = describe(name)
    for struct in (description, *referenced):
        for field in struct["fields"]:
            del field["default_value"]
    text = json.dumps({"type_description": description, "referenced_type_descriptions": referenced})
    return f"RIHS01_{sha256(text.encode()).hexdigest()}"
