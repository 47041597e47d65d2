"""The model of a rival, to be compensated in the place of a name."""

from __future__ import annotations

from identify.results import Identification
from identify.wording import plain
from rig import effects
from rig.errors import UsageError
from rig.platform import Platform


def rival_models(found: Identification, rival: str) -> dict[str, Platform]:
    """ "effect / rival" -> the model that was fitted with the rival in the place of the effect.

    Raises
    ------
    UsageError
        Where no name has that rival.
    """
    models = found.verdict.rival_models
    out = {f"{effect} / {rival}": by_rival[rival] for effect, by_rival in models.items() if rival in by_rival}
    if not out:
        known = sorted({name for by_rival in models.values() for name in by_rival})
        which = f"choose one of {', '.join(known)}" if known else "none of its effects has a fitted alternative"
        raise UsageError(
            f"--rival {rival}: {_inseparable(found, rival) or f'this result has no such alternative: {which}'}. "
            "Nothing was moved."
        )
    return out


def _inseparable(found: Identification, rival: str) -> str:
    """Why a proof cannot tell a rival from an effect of the model, where no data can; empty where that is not so."""
    names = () if found.final.platform is None or rival not in effects.names() else tuple(found.final.platform.effects)
    for name in names:
        why = effects.get(name).alike(rival, 0.0) or effects.get(rival).alike(name, 0.0)
        if why:
            return f"no proof tells it from {plain(name)}: {why}"
    return ""
