"""RIHS01 type hashes and the type descriptions that they hash (REP 2011, REP 2016)."""

from __future__ import annotations

import json
from hashlib import sha256
from typing import Any

from .definition import Field, FieldType, MessageDefinition
from .definition_files import ACTION_SERVICES, action_definition, message_definition, service_definition

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
    """Whether a full name is the name of a message or service that a service or action defines."""
    return "/msg/" not in name and "_" in name.rpartition("/")[2]


def _individual(name: str) -> MessageDefinition:
    """The type as a struct; a service or action is a struct of its messages and services."""
    members: dict[str, str] = {}
    if "/action/" in name and not is_part(name):
        action = action_definition(name)
        members = {
            "goal": action.goal.name,
            "result": action.result.name,
            "feedback": action.feedback.name,
            "send_goal_service": action.send_goal.name,
            "get_result_service": action.get_result.name,
            "feedback_message": action.feedback_message.name,
        }
    elif ("/srv/" in name and not is_part(name)) or name.endswith(tuple(f"_{s}" for s in ACTION_SERVICES)):
        service = service_definition(name)
        members = {
            "request_message": service.request.name,
            "response_message": service.response.name,
            "event_message": service.event.name,
        }
    else:
        return message_definition(name)
    return MessageDefinition(
        name, tuple(Field(member, FieldType(type_)) for member, type_ in members.items())
    )


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
    """The descriptions of a type and of all types in it, the latter sorted by name."""
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
    """RIHS01 hash of an interface: SHA-256 of its description in JSON without default values."""
    description, referenced = describe(name)
    for struct in (description, *referenced):
        for field in struct["fields"]:
            del field["default_value"]
    text = json.dumps({"type_description": description, "referenced_type_descriptions": referenced})
    return f"RIHS01_{sha256(text.encode()).hexdigest()}"
