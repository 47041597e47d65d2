"""Effects in the JSON schema of rig.yaml: each known one with its parameters, and room for those of your own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import TYPE_CHECKING

from rig.config.json_schema import Json
from rig.errors import ConfigError

if TYPE_CHECKING:
    from rig.effects import Effect, Parameter

NAME = "^[a-z][a-z0-9_]*$"
# Where a file may bring in effects that the schema cannot know: another file, your own code, measured channels.
ELSEWHERE: tuple[tuple[str, ...], ...] = (
    ("model", "effects_from"),
    ("simulated", "platform", "effects_from"),
    ("model", "channels"),
    ("simulated", "platform", "channels"),
    ("identify", "channels"),
    ("recorded", "columns", "channels"),
)
INCLUDED: tuple[tuple[str, ...], ...] = (("model",), ("simulated", "platform"))


def effects_schema(definitions: Json) -> Json:
    """The mapping under `effects:`; adds a definition for each known effect.

    A name that is not known is let through here, as one of your own: ``known_effects_only`` refuses it.
    """
    for name, effect in _known():
        definitions[f"effect_{name}"] = _effect(effect) if effect else dict(_OWN)
    names = {name: {"$ref": f"#/definitions/effect_{name}"} for name, _ in _known()}
    return {"type": "object", "properties": names, "propertyNames": {"pattern": NAME}, "additionalProperties": _OWN}


def candidates_schema() -> Json:
    """One entry of `identify.candidates`: a known name, or one of your own."""
    from rig import effects  # noqa: PLC0415  compiled kernels: only where they are wanted

    return {"anyOf": [{"enum": list(effects.names())}, {"type": "string", "pattern": NAME}]}


def known_effects_only() -> Json:
    """A condition for the whole file: where it brings in no effects from elsewhere, only known names may stand."""
    from rig import effects  # noqa: PLC0415  as above

    model = {"properties": {"effects": {"propertyNames": {"enum": [name for name, _ in _known()]}}}}
    candidates = {"anyOf": [{"type": "null"}, {"items": {"enum": list(effects.names())}}]}
    brings = [_has(path, {}) for path in ELSEWHERE] + [_has(path, {"type": "string"}) for path in INCLUDED]
    return {
        "if": {"not": {"anyOf": brings}},
        "then": {
            "properties": {
                "model": model,
                "simulated": {"properties": {"platform": model}},
                "identify": {"properties": {"candidates": candidates}},
            }
        },
    }


_OWN: Json = {"type": "object", "additionalProperties": {"type": "number"}}


def _has(path: tuple[str, ...], value: Json) -> Json:
    """True of a mapping that has a key at ``path`` with such a value."""
    inner = value if len(path) == 1 else _has(path[1:], value)
    return {"type": "object", "required": [path[0]], "properties": {path[0]: inner}}


def _known() -> Iterator[tuple[str, Effect | None]]:
    """Every effect a model may hold, further orders and other forms included; None for one that cannot be loaded."""
    from rig import effects  # noqa: PLC0415  as above

    for first in effects.names():
        for name in (first, *effects.further(first), *effects.forms(first)):
            try:
                yield name, effects.get(name)
            except ConfigError:  # of an installed package that is broken: that is said where it is used
                yield name, None


def _effect(effect: Effect) -> Json:
    parameters = {p.key: _parameter(p) for p in effect.parameters}
    # Without its unit a key is understood too, but not proposed.
    short = {f"^{p.name}$": _parameter(p) for p in effect.parameters if p.name not in parameters}
    found: Json = {
        "description": f"{effect.meaning} {effect.equation}",
        "type": "object",
        "properties": parameters,
        "additionalProperties": False,
    }
    if short:
        found["patternProperties"] = short
    if effect.parameters:
        found["allOf"] = [_required(p) for p in effect.parameters]
    return found


def _required(parameter: Parameter) -> Mapping[str, object]:
    spellings = dict.fromkeys((parameter.key, parameter.name))
    several = [{"required": [key]} for key in spellings]
    return several[0] if len(several) == 1 else {"anyOf": several}


def _parameter(parameter: Parameter) -> Json:
    bounds = {"minimum": parameter.low, "maximum": parameter.high}
    unit = f", {parameter.unit}" if parameter.unit not in ("", "1") else ""
    return {
        "description": f"{parameter.meaning}{unit}",
        "type": "number",
        **{key: value for key, value in bounds.items() if isfinite(value)},
    }
