"""A section of rig.yaml as JSON schema: the pydantic model with a description for every key.

JSON Schema draft 7, the newest that all editors know; there a `$ref` hides what stands beside it.
"""

from __future__ import annotations

import inspect
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema

from rig.config.field_docs import field_docs

DRAFT = "http://json-schema.org/draft-07/schema#"
Json = dict[str, Any]


class _Described(GenerateJsonSchema):
    """Adds the text under each field, and leaves out titles, which only repeat the keys."""

    def model_schema(self, schema: Any) -> Any:
        found = super().model_schema(schema)
        model: type[BaseModel] = schema["cls"]
        found.pop("title", None)
        if model.__doc__:
            found["description"] = _plain(inspect.cleandoc(model.__doc__).split("\n\n")[0])
        docs = field_docs(model)
        for key, value in found.get("properties", {}).items():
            value.pop("title", None)
            if key in docs:
                value["description"] = _plain(docs[key])
        return found


def model_schema(model: type[BaseModel]) -> Json:
    """The JSON schema of a section; sections within it stand under ``definitions``."""
    found = model.model_json_schema(ref_template="#/definitions/{model}", schema_generator=_Described)
    definitions = found.pop("$defs", {})
    cleaned: Json = _cleaned(found)
    if definitions:
        cleaned["definitions"] = {name: _cleaned(one) for name, one in definitions.items()}
    return cleaned


def _plain(text: str) -> str:
    return " ".join(text.replace("``", "`").split())


def _cleaned(value: Any) -> Any:
    """References with nothing beside them; no defaults that are null or a whole section."""
    if isinstance(value, list):
        return [_cleaned(item) for item in value]
    if not isinstance(value, dict):
        return value
    is_field = "type" in value or "anyOf" in value or "$ref" in value or "oneOf" in value
    found = {
        key: _cleaned(item)
        for key, item in value.items()
        if not (is_field and key == "default" and (item is None or isinstance(item, dict)))
    }
    reference = found.pop("$ref", None) if isinstance(found.get("$ref"), str) and len(found) > 1 else None
    return found | {"allOf": [{"$ref": reference}]} if reference else found
