"""`rig schema`: the JSON schema of rig.yaml with the devices' own settings, for editors."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from commands.terminal.exit_codes import OK

if TYPE_CHECKING:
    from drivers.settings import Settings
    from rig.config.json_schema import Json


def print_schema() -> int:
    """Print the schema on stdout; returns the exit code."""
    sys.stdout.write(json.dumps(schema(), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    return OK


def schema() -> Json:
    """The schema of rig.yaml; on a bench each device takes its own settings and no others."""
    from drivers import amplifiers, gyroscopes
    from rig.config.bench import AmplifierConfig, GyroscopeConfig
    from rig.config.schema import config_schema

    found = config_schema()
    standard = {"gyroscope": GyroscopeConfig().device, "amplifier": AmplifierConfig().device}
    devices = {
        "gyroscope": _device(tuple(gyroscopes.DRIVERS), gyroscopes.settings_model, standard["gyroscope"]),
        "amplifier": _device(tuple(amplifiers.DRIVERS), amplifiers.settings_model, standard["amplifier"]),
    }
    # With another backend the devices are not looked at, and a file for a bench that is still to come is no fault.
    is_bench = {"properties": {"backend": {"const": "bench"}}, "required": ["backend"]}
    found["allOf"].append({"if": is_bench, "then": {"properties": {"bench": {"properties": devices}}}})
    return found


def _device(names: Sequence[str], settings_of: Callable[[str], type[Settings] | None], standard: str) -> Json:
    models = {name: model for name in names if (model := settings_of(name)) is not None}
    return {
        "properties": {"device": {"enum": list(names)}},
        "allOf": [_own_settings(name, model, name == standard) for name, model in models.items()],
    }


def _own_settings(name: str, model: type[Settings], is_standard: bool) -> Json:
    """Where the device is ``name`` (also by default), its settings and no others."""
    from rig.config.json_schema import model_schema

    is_this: dict[str, Any] = {"properties": {"device": {"const": name}}}
    if not is_standard:
        is_this["required"] = ["device"]
    settings = model_schema(model)
    then: dict[str, Any] = {"properties": {"settings": settings}}
    if settings.get("required"):
        then["required"] = ["settings"]
    return {"if": is_this, "then": then}
