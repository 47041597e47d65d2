"""Effects as rig.yaml writes them: effect name -> parameter key -> value, checked against the registry."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Annotated

from pydantic import AfterValidator

EffectValues = Mapping[str, Mapping[str, float]]


def unknown(kind: str, word: str, allowed: Iterable[str]) -> str:
    """The sentence for a word that is not in the list: the nearest one and the whole list."""
    known = list(allowed)
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    hint = f", did you mean {near[0]!r}?" if near else ""
    return f"unknown {kind} {word[:60]!r}{hint} (known: {', '.join(known)})"


def check_effect_names(names: Iterable[str]) -> None:
    """Raise ValueError naming every effect that does not exist, with the nearest one that does."""
    from rig import effects  # noqa: PLC0415  compiled kernels: not paid for by a config that names no effect

    known = effects.names()
    wrong = [unknown("effect", name, known) for name in names if name not in known]
    if wrong:
        raise ValueError("; ".join(wrong))


def check_effects(given: EffectValues) -> EffectValues:
    """Check effect names, parameter keys and bounds; keys come back as the parameters' plain names.

    Raises ValueError that lists everything wrong at once.
    """
    if not given:
        return given
    check_effect_names(given)
    from rig import effects  # noqa: PLC0415

    wrong: list[str] = []
    checked: dict[str, dict[str, float]] = {}
    for name, values in given.items():
        effect = effects.get(name)
        by_key = {p.name: p for p in effect.parameters} | {p.key: p for p in effect.parameters}
        keys = [p.key for p in effect.parameters]
        wrong += [f"{name}: {unknown('parameter', k, keys)}" for k in values if k not in by_key]
        found = {by_key[k].name: v for k, v in values.items() if k in by_key}
        for p in effect.parameters:
            if p.name not in found:
                wrong.append(f"{name}: {p.key} is missing ({p.meaning}, in {p.unit or 'no unit'})")
            elif not p.low <= found[p.name] <= p.high:
                wrong.append(f"{name}: {p.key} = {found[p.name]:g} is outside {p.low:g} to {p.high:g}")
        checked[name] = {p.name: found[p.name] for p in effect.parameters if p.name in found}
    if wrong:
        raise ValueError("; ".join(wrong))
    return checked


EffectsConfig = Annotated[Mapping[str, Mapping[str, float]], AfterValidator(check_effects)]
