"""The JSON schema of plans, made of the models and of the kit's signatures: editors complete a plan by it."""

from __future__ import annotations

import json
from typing import Any

from pydantic import BaseModel

from aerialdojo_gen.scenes.kit import kit
from aerialdojo_gen.scenes.plans.model import Ground, Paint, Place, PlanHead, Structure
from aerialdojo_gen.scenes.vocabulary import SHAPES


def plan_schema() -> dict[str, Any]:
    """Return the schema, JSON Schema 2020-12."""
    definitions: dict[str, Any] = {}
    whole = _schema(PlanHead, definitions)
    builders = {
        kind: [_builder(name, definitions) for name, one in kit().items() if one.kind == kind]
        for kind in ("site", "ground", "parts")
    }
    structure, place = _schema(Structure, definitions), _schema(Place, definitions)
    structure["properties"]["parts"]["items"] = {
        "anyOf": [
            *builders["parts"],
            {"type": "object", "required": ["shape", "role"], "properties": {"shape": {"enum": sorted(SHAPES)}}},
        ]
    }
    ground = _schema(Ground, definitions)
    ground["properties"]["steps"]["items"] = {"anyOf": builders["ground"]}
    entries = [_schema(Paint, definitions), structure, place, *builders["site"]]
    definitions["Entry"] = {"anyOf": entries}
    one = {"$ref": "#/$defs/Entry"}
    several = {
        "type": "object", "description": "Short entries, one a line.", "required": ["entries"],
        "properties": {"entries": {"type": "array", "items": one}}, "additionalProperties": False,
    }  # fmt: skip
    whole["properties"] |= {"ground": ground, "site": {"type": "array", "items": {"anyOf": [one, several]}}}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Plan of a scene", **whole} | {
        "$defs": dict(sorted(definitions.items()))
    }


def schema_text() -> str:
    """Return the schema as the file `scene_assets/plan.schema.json` holds it."""
    return json.dumps(plan_schema(), indent=1, ensure_ascii=False) + "\n"


def _schema(model: type[BaseModel], definitions: dict[str, Any]) -> dict[str, Any]:
    schema = model.model_json_schema(mode="validation")
    for name, one in schema.pop("$defs", {}).items():
        if definitions.setdefault(name, one) != one:
            raise ValueError(f"two classes of the kit's arguments are called {name}: rename one")
    return schema


def _builder(name: str, definitions: dict[str, Any]) -> dict[str, Any]:
    one = kit()[name]
    schema = _schema(one.arguments, definitions)
    keys = {"make": {"const": name}, **schema.get("properties", {})}
    if one.kind == "site":
        keys["as"] = {"type": ["string", "array"], "items": {"type": "string"}}
    return {
        "type": "object", "title": name, "description": one.summary, "properties": keys,
        "required": ["make", *schema.get("required", [])], "additionalProperties": False,
    }  # fmt: skip
