"""Settings that only one device has: a mapping in rig.yaml, checked by the driver's own model."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from rig.config.bench import Setting
from rig.errors import ConfigError


class Settings(BaseModel):
    """Base of a driver's settings: unknown keys and NaN are errors, values are frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class SettingsError(ConfigError):
    """Settings that are wrong by themselves, whatever stands beside them in the section."""


S = TypeVar("S", bound=Settings)


def read_settings(model: type[S], given: Mapping[str, Setting], where: str) -> S:
    """The settings as the driver's model.

    Parameters
    ----------
    where
        Path of the mapping in rig.yaml, for messages: "bench.gyroscope.settings".

    Raises
    ------
    SettingsError
        With every wrong key, its value and what is allowed.
    """
    try:
        return model.model_validate(dict(given))
    except ValidationError as wrong:
        lines = [_line(model, error, where) for error in wrong.errors(include_url=False)]
        raise SettingsError("\n".join(lines)) from None


def _line(model: type[Settings], error: object, where: str) -> str:
    assert isinstance(error, dict)
    key = ".".join(str(part) for part in error["loc"])
    if error["type"] == "extra_forbidden":
        near = get_close_matches(key, model.model_fields, 1)
        hint = f"did you mean {near[0]}?" if near else f"this device knows {', '.join(model.model_fields)}"
        return f"{where}.{key}: unknown key; {hint}"
    return f"{where}.{key}: {error['input']!r} is not allowed: {error['msg']}"
