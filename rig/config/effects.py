"""Effects as rig.yaml writes them: effect name -> parameter key -> value, checked against the registry."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated

from pydantic import AfterValidator

from rig.config.parsing.suggestions import KeyFaults, unknown

if TYPE_CHECKING:
    from rig.effects import Effect, Parameter

EffectValues = Mapping[str, Mapping[str, float]]


def check_effect_names(names: Sequence[str]) -> None:
    """Raise KeyFaults naming every effect of a list that does not exist, with the nearest one that does, or repeats."""
    from rig import effects  # noqa: PLC0415  compiled kernels: not paid for by a config that names no effect

    known = effects.known()
    wrong: list[tuple[tuple[str | int, ...], str]] = []
    for i, name in enumerate(names):
        if name not in known:
            wrong.append(((i,), unknown("effect", name, known)))
        elif name in names[:i]:
            wrong.append(((i,), f"{name!r} is listed twice"))
    if wrong:
        raise KeyFaults(wrong)


def check_effects(given: EffectValues) -> EffectValues:
    """Check effect names, parameter keys and bounds; keys come back as the parameters' plain names.

    Raises KeyFaults with everything wrong at once.
    """
    if not given:
        return given
    from rig import effects  # noqa: PLC0415  as above

    known = effects.known()
    wrong: list[tuple[tuple[str | int, ...], str]] = []
    checked: dict[str, Mapping[str, float]] = {}
    for name, values in given.items():
        if effects.exists(name):
            checked[name], faults = _check_values(effects.get(name), values)
            wrong += [((name, *key), text) for key, text in faults]
        else:
            wrong.append(((name,), unknown("effect", name, known)))
    if wrong:
        raise KeyFaults(wrong)
    return checked


def _check_values(
    effect: Effect, values: Mapping[str, float]
) -> tuple[dict[str, float], list[tuple[tuple[str, ...], str]]]:
    by_key = {p.name: p for p in effect.parameters} | {p.key: p for p in effect.parameters}
    keys = [p.key for p in effect.parameters]
    wrong: list[tuple[tuple[str, ...], str]] = []
    wrong += [((k,), unknown("parameter", k, keys)) for k in values if k not in by_key]
    written = {by_key[k].name: k for k in values if k in by_key}
    for p in effect.parameters:
        if p.name not in written:
            wrong.append(((), f"parameter {p.key} is missing ({p.meaning}, in {p.unit or 'no unit'}): add it"))
            continue
        value = values[written[p.name]]
        if not p.low <= value <= p.high:
            wrong.append(((written[p.name],), f"{value:g} is not allowed: has to be {_range(p)}"))
    return {p.name: values[written[p.name]] for p in effect.parameters if p.name in written}, wrong


def _range(parameter: Parameter) -> str:
    if math.isinf(parameter.high):
        return f"at least {parameter.low:g}"
    if math.isinf(parameter.low):
        return f"at most {parameter.high:g}"
    return f"{parameter.low:g} to {parameter.high:g}"


EffectsConfig = Annotated[Mapping[str, Mapping[str, float]], AfterValidator(check_effects)]
