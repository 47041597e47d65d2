"""What pydantic found wrong, said for the person who wrote the file."""

from __future__ import annotations

import typing
from collections.abc import Iterable
from types import UnionType
from typing import Any, Literal

from pydantic import BaseModel, ValidationError

from rig.config.parsing.suggestions import KeyFaults, unknown
from rig.config.parsing.yaml_text import Document, Fault, KeyPath, Place

_WANTED = {
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number, without point or exponent",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number, without point or exponent",
    "string_type": 'text (a number, true or null as text needs "quotes")',
    "bool_type": "true or false (on, off, yes and no are plain text here)",
    "bool_parsing": "true or false (on, off, yes and no are plain text here)",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a mapping of keys to values",
    "model_type": "a mapping of keys to values",
    "mapping_type": "a mapping of keys to values",
    "model_attributes_type": "a mapping of keys to values",
    "none_required": "nothing (null)",
    "finite_number": "a finite number",
    "greater_than": "more than {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "too_short": "at least {min_length} long",
    "too_long": "at most {max_length} long",
    "string_too_short": "at least {min_length} characters",
    "string_too_long": "at most {max_length} characters",
    "literal_error": "{expected}",
    "enum": "{expected}",
}


def faults_of(error: ValidationError, document: Document, root: type[BaseModel]) -> list[Fault]:
    """Every error of a validation as a fault with its place; alternatives of one value are put together."""
    grouped: dict[tuple[KeyPath, str | None], list[Any]] = {}
    for item in error.errors(include_url=False):
        path = _data_path(item["loc"], item["type"], document.data)
        single = item["type"] if item["type"] in ("missing", "extra_forbidden") else None
        grouped.setdefault((path, single), []).append(item)
    faults: list[Fault] = []
    for (path, kind), items in grouped.items():
        inner = [i["ctx"]["error"] for i in items if isinstance(i.get("ctx", {}).get("error"), KeyFaults)]
        if inner:
            texts = [((*path, *key), text) for error in inner for key, text in error.faults]
        else:
            texts = [(path, _text(kind, path, items, document.data, root))]
        faults += [Fault(place_of(document, where), where, text) for where, text in texts]
    return faults


def place_of(document: Document, path: KeyPath) -> Place:
    """Where ``path`` or the nearest thing around it was written."""
    for length in range(len(path), -1, -1):
        if path[:length] in document.places:
            return document.places[path[:length]]
    return document.places.get((), Place("config"))


def _data_path(loc: tuple[str | int, ...], kind: str, data: Any) -> KeyPath:
    """``loc`` without the names of union members and validators that pydantic puts in between."""
    path: KeyPath = ()
    for i, part in enumerate(loc):
        if _holds(data, part):
            data = data[part]
        elif not (kind == "missing" and i == len(loc) - 1):
            continue
        path = (*path, part)
    return path


def _holds(data: Any, part: str | int) -> bool:
    if isinstance(part, str):
        return isinstance(data, dict) and part in data
    return isinstance(data, list) and part < len(data)


def _text(kind: str | None, path: KeyPath, items: list[Any], data: Any, root: type[BaseModel]) -> str:
    if kind == "missing":
        return "is required and missing: add it"
    if kind == "extra_forbidden":
        allowed = allowed_keys(root, data, path[:-1])
        return unknown("key", str(path[-1]), allowed) if allowed else "no keys are allowed here"
    own = [i["ctx"]["error"] for i in items if i["type"] in ("value_error", "assertion_error")]
    if own:
        return "; ".join(dict.fromkeys(str(e) for e in own))
    if items[0]["type"] == "union_tag_invalid":
        kinds = [tag.strip("' ") for tag in items[0]["ctx"]["expected_tags"].split(",")]
        return unknown("kind", str(items[0]["ctx"]["tag"]), kinds)
    wanted = list(dict.fromkeys(_wanted(item) for item in items))
    return f"{shown(_at(data, path))} is not allowed: has to be {' or '.join(wanted)}"


def _wanted(item: Any) -> str:
    template = _WANTED.get(item["type"])
    context = {k: f"{v:g}" if isinstance(v, float) else v for k, v in item.get("ctx", {}).items()}
    return template.format(**context) if template else str(item["msg"])


def shown(value: Any) -> str:
    """A value as the person wrote it, cut to a readable length."""
    text = {None: "nothing (null)", True: "true", False: "false"}.get(value) if _is_plain(value) else None
    if isinstance(value, dict) and value:
        text = f"a mapping of {', '.join(str(k) for k in value)}"
    elif isinstance(value, list) and value:
        text = f"a list of {len(value)}"
    text = text or repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _is_plain(value: Any) -> bool:
    return value is None or isinstance(value, bool)


def _at(data: Any, path: KeyPath) -> Any:
    for part in path:
        data = data[part]
    return data


def allowed_keys(root: type[BaseModel], data: Any, path: KeyPath) -> list[str]:
    """Keys that the section at ``path`` takes; of a union, those of the members that ``data`` can mean."""
    models = {root: None}
    for part in path:
        data = data[part]
        found: dict[type[BaseModel], None] = {}
        for model in models:
            fields = model.model_fields
            if isinstance(part, str) and part in fields:
                found.update(dict.fromkeys(_models_in(fields[part].annotation)))
            elif isinstance(part, int) or part not in fields:
                found[model] = None  # an item of a list or mapping: its models were found one level up
        models = found
    meant = [m for m in models if _tags_fit(m, data)] or list(models)
    return sorted({name for model in meant for name in model.model_fields})


def _models_in(annotation: Any) -> Iterable[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if typing.get_origin(annotation) is not None or isinstance(annotation, UnionType):
        return [m for arg in typing.get_args(annotation) for m in _models_in(arg)]
    if hasattr(annotation, "__value__"):
        return _models_in(annotation.__value__)
    return []


def _tags_fit(model: type[BaseModel], data: Any) -> bool:
    """Whether every one-word key of ``model`` (the tag of a union) agrees with what is written."""
    if not isinstance(data, dict):
        return True
    for name, info in model.model_fields.items():
        if typing.get_origin(info.annotation) is Literal and name in data:
            words = typing.get_args(info.annotation)
            if len(words) == 1 and data[name] not in words:
                return False
    return True
