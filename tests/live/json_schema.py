"""Checks messages against the published schema: the part of JSON Schema 2020-12 that it uses."""

from __future__ import annotations

import json
from importlib.resources import files

SCHEMA = json.loads((files("oarlock.live") / "messages.schema.json").read_text(encoding="utf-8"))
TYPES = {
    "object": dict,
    "array": list,
    "string": str,
    "number": (int, float),
    "integer": int,
    "boolean": bool,
    "null": type(None),
}
KEYWORDS = {"$ref", "const", "enum", "type", "properties", "required", "additionalProperties", "items"}
KEYWORDS |= {"minItems", "maxItems", "anyOf", "description", "$schema", "title", "$defs"}


def mismatches(message, name):
    """What of a message is not as the definition says; a key that it does not name is a mismatch, too."""
    return list(_mismatches(message, {"$ref": f"#/$defs/{name}"}, name))


def _mismatches(value, schema, place):
    assert set(schema) <= KEYWORDS, "this checker knows the keyword"
    if "$ref" in schema:
        yield from _mismatches(value, SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]], place)
        return
    if "const" in schema and value != schema["const"]:
        yield f"{place}: is {value!r}, not {schema['const']!r}"
    if "enum" in schema and value not in schema["enum"]:
        yield f"{place}: is {value!r}, none of {schema['enum']}"
    if "type" in schema and not any(_is_a(value, kind) for kind in _list(schema["type"])):
        yield f"{place}: is {str(value)[:60]!r}, not of type {schema['type']}"
        return
    if isinstance(value, dict):
        yield from _of_object(value, schema, place)
    if isinstance(value, list):
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)):
            yield f"{place}: has {len(value)} items"
        for number, item in enumerate(value):
            yield from _mismatches(item, schema.get("items", {}), f"{place}[{number}]")


def _of_object(value, schema, place):
    properties = schema.get("properties")
    for key in schema.get("required", ()):
        if key not in value:
            yield f"{place}: lacks {key}"
    for key, inner in value.items():
        if properties is not None and key in properties:
            yield from _mismatches(inner, properties[key], f"{place}.{key}")
        elif "additionalProperties" in schema:
            yield from _mismatches(inner, schema["additionalProperties"], f"{place}.{key}")
        elif properties is not None:
            yield f"{place}: has {key}, which the schema does not name"


def _list(kinds):
    return kinds if isinstance(kinds, list) else [kinds]


def _is_a(value, kind):
    return isinstance(value, TYPES[kind]) and (kind == "boolean" or not isinstance(value, bool))
