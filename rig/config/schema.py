"""The JSON schema of rig.yaml: what a user may write, which is more than the checked models hold.

A section may be empty, a model or an excitation may be the path of a file, `name` may be left out, and effects go by
names that only the registry knows. What depends on two keys at once (a window that ends before it begins) is left to
the loader.
"""

from __future__ import annotations

from rig.channels import MAX_CHANNELS
from rig.config.effects_schema import candidates_schema, effects_schema, known_effects_only
from rig.config.excitation import MAX_SETS
from rig.config.json_schema import DRAFT, Json, model_schema
from rig.config.recorded import MAX_RUNS
from rig.config.root import BACKENDS, Config
from rig.config.simulated import NEVER_NEGATIVE

_IN_A_NAME = r'[^\x00-\x1f\x7f/\\<>:"|?*]'
_AT_ITS_ENDS = r'[^\x00-\x1f\x7f/\\<>:"|?* .]'
NAME_PATTERN = f"^{_AT_ITS_ENDS}({_IN_A_NAME}*{_AT_ITS_ENDS})?$"
CHANNEL_NAME = "^[a-z][a-z0-9_]{0,39}$"
FILE_PATTERN = r"^(?!.*://).*\S"
NEVER_EMPTY = ("name", "backend", "recorded")  # `recorded:` with nothing under it lacks its runs


def config_schema() -> Json:
    """The schema of a whole rig.yaml, JSON Schema draft 7. Device settings are left open: see the drivers.

    It refuses no file that the loader takes.
    """
    schema = model_schema(Config)
    sections, definitions = schema["properties"], schema["definitions"]
    _or_a_path(sections, "model", "excitation")
    _or_a_path(definitions["SimulatedConfig"]["properties"], "platform")
    for key in sections:
        if key not in NEVER_EMPTY:
            _or(sections, key, {"type": "null"})
    sections["recorded"] = _without_null(sections["recorded"])
    sections["name"]["pattern"] = NAME_PATTERN
    _narrow(definitions)
    _name_effects(definitions)
    return {
        "$schema": DRAFT,
        "title": "rig.yaml",
        **schema,
        "required": ["backend"],
        "allOf": [*(_needs_its_section(backend) for backend in BACKENDS), known_effects_only(), _truth_is_stable()],
    }


def _or(properties: Json, key: str, *alternatives: Json) -> None:
    """Let something else stand under ``key`` too; its description stays where editors look for it."""
    found = properties[key]
    described = {word: found.pop(word) for word in ("description", "default") if word in found}
    # A reference that had a description beside it was wrapped: now it can stand by itself again.
    inner = (found.get("anyOf") or found.get("allOf")) if len(found) == 1 else None
    several = inner or [found]
    properties[key] = {**described, "anyOf": [*several, *(a for a in alternatives if a not in several)]}


def _or_a_path(properties: Json, *keys: str) -> None:
    for key in keys:
        _or(properties, key, {"type": "string", "description": "Path of a file, relative to this one."})


def _without_null(found: Json) -> Json:
    return {**found, "anyOf": [one for one in found["anyOf"] if one != {"type": "null"}]}


def _needs_its_section(backend: str) -> Json:
    asked = {"properties": {"backend": {"const": backend}}, "required": ["backend"]}
    return {"if": asked, "then": {"required": [backend]}}


def _truth_is_stable() -> Json:
    """A declared model may push away from rest, the simulated platform, which is played, may not."""
    platform = {"properties": {key: {"minimum": 0} for key in NEVER_NEGATIVE}}
    return {"properties": {"simulated": {"properties": {"platform": platform}}}}


def _narrow(definitions: Json) -> None:
    """What validators of single keys refuse."""
    model = definitions["ModelConfig"]["properties"]
    model["terms"] |= {"uniqueItems": True, "contains": {"const": "inertia"}}
    _or(model, "effects_from", dict(model["effects_from"]["items"]))  # one file need not be a list
    definitions["ExcitationConfig"]["properties"]["sets"] |= {"minItems": 1, "maxItems": MAX_SETS}
    definitions["RecordedConfig"]["properties"]["runs"] |= {"minItems": 1, "maxItems": MAX_RUNS}
    definitions["RecordedRun"]["properties"]["file"]["pattern"] = FILE_PATTERN
    factors = [definitions["Scale"]["properties"][key] for key in ("torque", "rate", "angle")]
    for factor in (*factors, definitions["ChannelColumn"]["properties"]["scale"]):
        factor["not"] = {"const": 0}
    for section in ("ModelConfig", "IdentifyConfig", "Columns"):
        channels = definitions[section]["properties"]["channels"]
        channels |= {"propertyNames": {"pattern": CHANNEL_NAME}, "maxProperties": MAX_CHANNELS}


def _name_effects(definitions: Json) -> None:
    effects = definitions["ModelConfig"]["properties"]["effects"]
    described = effects["description"]
    effects.clear()
    effects |= {"description": described, **effects_schema(definitions)}
    listed = next(a for a in definitions["IdentifyConfig"]["properties"]["candidates"]["anyOf"] if "items" in a)
    listed |= {"items": candidates_schema(), "uniqueItems": True}
