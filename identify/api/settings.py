"""The keyword arguments of a call, checked as the keys of rig.yaml that they stand for."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast, get_args

import numpy as np

from rig.config.load import check_config
from rig.config.model import ModelConfig
from rig.config.root import Config
from rig.errors import ConfigError, InputError
from rig.platform import Platform
from rig.signals import Use

SOURCE = "identify"
# Keys of rig.yaml -> the arguments that stand for them, the longest first.
_ARGUMENTS = (
    ("identify.holdout", "holdout"), ("identify.channels", "channels"), ("identify", "settings"),
    ("recorded.axis", "axis"), ("recorded.torque_hold", "torque_hold"), ("recorded.noise", "noise"),
    ("model", "declared"),
)  # fmt: skip


@dataclass(frozen=True)
class Settings:
    """What was asked for: the configuration, ``use`` of every run, and the readings of further channels."""

    config: Config
    uses: tuple[Use, ...] | None
    readings: Mapping[str, Any]


def settings_of(
    declared: Any, axis: Any, holdout: Any, channels: Any, torque_hold: Any, noise: Any, further: Any
) -> Settings:
    """The arguments of ``identify.identify``, see there, as a configuration. Raises InputError."""
    plain_channels, readings = _channels(channels)
    uses = _uses(holdout)
    section = _plain("settings", further) if further is not None else {}
    if not isinstance(section, dict):
        raise InputError(f"settings is {further!r:.60}: pass a mapping with keys of the section identify of rig.yaml")
    twice = sorted({"holdout", "channels"} & set(section))
    if twice:
        raise InputError(f"settings holds {twice[0]!r}: pass it as {twice[0]}=")
    section |= {"channels": plain_channels} if plain_channels else {}
    section |= {} if uses is not None or holdout is None else {"holdout": _plain("holdout", holdout)}
    recorded = {
        "runs": [{"file": SOURCE}],
        "axis": _plain("axis", axis),
        "torque_hold": _plain("torque_hold", torque_hold),
    }
    recorded |= {} if noise is None else {"noise": _plain("noise", noise)}
    model = _model(declared)
    data = {"name": SOURCE, "backend": "recorded", "recorded": recorded, "identify": section, "model": model}
    try:
        return Settings(check_config(data, SOURCE), uses, readings)
    except ConfigError as error:
        raise InputError("\n".join(_as_argument(line) for line in str(error).splitlines())) from None


def _model(declared: Any) -> Any:
    """A mapping as under ``model:``, or the path of a model.yaml."""
    if declared is None:
        return {}
    if isinstance(declared, Path):
        return str(declared)
    if isinstance(declared, Platform):
        try:
            declared = ModelConfig.from_platform(declared)
        except (ValueError, KeyError) as error:
            raise InputError(f"declared: this platform is not a valid model ({error}): correct it") from None
    if isinstance(declared, ModelConfig):
        return declared.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    if not isinstance(declared, Mapping | str):
        raise InputError(
            f"declared is {declared!r:.60}: pass a mapping as under model: in rig.yaml, e.g. "
            "{'inertia_kg_m2': 0.02}, or the path of a model.yaml"
        )
    return _plain("declared", declared)


def _uses(holdout: Any) -> tuple[Use, ...] | None:
    """One use a run, where ``holdout`` is a list of them."""
    if not isinstance(holdout, list | tuple):
        return None
    known = get_args(Use)
    for i, use in enumerate(holdout):
        if not isinstance(use, str) or use not in known:
            raise InputError(
                f"holdout[{i}] is {use!r:.40}: give {', '.join(map(repr, known))} for every run, or one share"
            )
    if all(use == "holdout" for use in holdout):
        raise InputError("holdout holds out every run, so nothing is left to fit: set 'fit' for at least one")
    return tuple(cast(Sequence[Use], holdout))


def _channels(channels: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """What the channels are, as rig.yaml has it, and their readings."""
    if channels is None:
        return {}, {}
    if not isinstance(channels, Mapping) or not all(isinstance(c, Mapping) for c in channels.values()):
        raise InputError(
            f"channels is {channels!r:.60}: pass {{name: {{'kind': ..., 'values': array}}}}, the kinds as in rig.yaml"
        )
    readings = {str(name): c["values"] for name, c in channels.items() if c.get("values") is not None}
    plain = {str(n): {k: v for k, v in c.items() if k != "values"} for n, c in channels.items()}
    return cast(dict[str, Any], _plain("channels", plain)), readings


def _plain(name: str, value: Any) -> Any:
    """Numbers, texts, lists and mappings as YAML would give them. Raises InputError for anything else."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        raise InputError(f"{name} is {value:g}: give a finite number")
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, Mapping):
        return {str(k): _plain(f"{name}[{k!r}]", v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(f"{name}[{i}]", v) for i, v in enumerate(value)]
    shown = f"an array of shape {value.shape}" if isinstance(value, np.ndarray) else f"{value!r:.60}"
    raise InputError(f"{name} is {shown}, which rig.yaml cannot hold: give a number, text, list or mapping")


def _as_argument(line: str) -> str:
    """A line about a key of rig.yaml as one about the argument that stands for it."""
    line = line.removeprefix(f"{SOURCE}: ")
    of_file = re.match(r".+?:\d+: ", line)  # of a model.yaml, which has lines
    where = of_file.group() if of_file else ""
    text = line.removeprefix(where)
    for key, argument in _ARGUMENTS:
        if re.match(rf"{re.escape(key)}[.:]", text):
            return f"{where}{argument}{text.removeprefix(key)}"
    return line
