"""What each named effect contributes: how much larger the held-out error is where it alone is taken out again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from identify.estimate.output_error import OutputErrorFit
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.rivals import whole_runs
from identify.rivals.whole_runs import FreeRunFitter
from rig.platform import TERMS

CONTRIBUTION_STEPS = 4  # of a fit that begins where the rest stands: the ratio to a few percent is what is asked for


def contributions(
    fits: FreeRunFitter,
    structure: Structure,
    values: Mapping[Name, float],
    named: Sequence[str],
    base: Mapping[Name, float],
    horizon_s: float = 1.0,
) -> dict[str, float]:
    """Held-out free-run error without an effect, the rest fitted anew, over the error with it.

    Both on the same samples. ``base`` are the values of the declared model alone: a term of it that the effects made
    needless comes back. ``horizon_s`` is how far ahead a decay is fitted first. An effect without which the model runs
    away has no number.
    """
    full = fits.fitted(structure, values, steps=_steps(fits)) if named else None
    if full is None or full.held_out_chi_square <= 0.0:
        return {}
    out = {}
    for name in named:
        without = _without(
            fits, structure.minus(name), {n: v for n, v in values.items() if n[0] != name}, base, horizon_s
        )
        if without is not None:
            out[name] = float(np.sqrt(without.held_out_chi_square / full.held_out_chi_square))
    return out


def _without(
    fits: FreeRunFitter, structure: Structure, rest: Mapping[Name, float], base: Mapping[Name, float], horizon_s: float
) -> OutputErrorFit | None:
    """The model without an effect, with every term that was declared."""
    gone: dict[Name, float] = {n: v for n, v in base.items() if len(n) == 1 and n not in rest}
    structure = replace(structure, terms=tuple(t for t in TERMS if t in structure.terms or (t,) in gone))
    start = {**rest, **dict.fromkeys(gone, 0.0)}
    if not fits.torque_free:
        return fits.fitted(structure, start, steps=_steps(fits))
    # A decay that loses step with the data is in a false minimum: a short horizon leads out, from either end.
    ends = [start, {**rest, **gone}] if gone else [start]
    tried = [fits.fitted(structure, values, horizon_s=horizon_s) for values in ends]
    return min((w for w in tried if w is not None), key=lambda w: w.cost, default=None)


def _steps(fits: FreeRunFitter) -> int:
    return whole_runs.WHOLE_RUN_STEPS if fits.torque_free else CONTRIBUTION_STEPS
