"""The model of a rival, to be compensated in the place of a name."""

from __future__ import annotations

from identify.results import Identification
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
        raise UsageError(f"--rival {rival}: this result has no such alternative: {which}. Nothing was moved.")
    return out
