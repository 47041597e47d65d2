"""What each named effect contributes: how much larger the held-out error is where it alone is taken out again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from identify.fits import Fits
from identify.parameters import Name
from identify.regression import Structure

STEPS = 4  # of a fit that begins where the rest stands: the ratio to a few percent is what is asked for


def contributions(
    fits: Fits, structure: Structure, values: Mapping[Name, float], named: Sequence[str]
) -> dict[str, float]:
    """Held-out free-run error without an effect, the rest fitted anew, over the error with it.

    Both on the same samples. An effect without which the model runs away has no number.
    """
    full = fits.whole(structure, values, steps=1) if named else None
    if full is None or full.held <= 0.0:
        return {}
    out = {}
    for name in named:
        rest = {n: v for n, v in values.items() if n[0] != name}
        without = fits.whole(structure.minus(name), rest, steps=STEPS)
        if without is not None:
            out[name] = float(np.sqrt(without.held / full.held))
    return out
