"""The unit of the time: what the file says of it, weighed against what its numbers allow."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rig.arrays import Array
from rig.recording.consistency import DAY_S, FASTEST_STEP_S, SLOWEST_STEP_S, is_excel_date, usual_step
from rig.recording.guessing.columns import Column
from rig.recording.guessing.factor import Factor
from rig.recording.guessing.roles import COUNTERS

# Seconds since 1970 of the years 2001 to 2286, in units that are told apart by the size of the numbers alone.
_EPOCH_S = (1e9, 1e10)
_SHORT: Mapping[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_LONG: Mapping[str, float] = {"min": 60.0, "h": 3600.0, "days": DAY_S}


def time_factor(column: Column, stated: Factor | None) -> Factor:
    """The factor to seconds.

    ``stated`` is what the file says; it is doubted where no platform is sampled so fast.
    """
    values = column.values
    assert values is not None
    step = usual_step(values)
    if stated is not None:
        if stated.value is None and not stated.sure:
            return stated  # a unit that is not known: the numbers must not overrule it
        per_s = stated.value or (column.known_unit.factor if column.known_unit else 1.0)
        return _doubted(values, step, per_s, stated) or stated
    return _by_numbers(column, values, step)


def _by_numbers(column: Column, values: Array, step: float) -> Factor:
    if is_excel_date(values):
        return Factor(DAY_S, f"days, a date as Excel counts them, as they lie {step:.3g} apart", True)
    for unit, factor in _SHORT.items():
        first, last = factor * np.nanmin(values), factor * np.nanmax(values)
        if _EPOCH_S[0] <= first and last < _EPOCH_S[1] and FASTEST_STEP_S <= factor * step < SLOWEST_STEP_S:
            return Factor(factor, f"{unit} since 1970, as samples are {step:.4g} apart", True)
    if set(column.words) & COUNTERS and bool(np.all(np.diff(values) == 1.0)):
        return Factor(None, "it counts samples, so the time between two of them has to be known", False)
    plain = Factor(1.0, f"s, as samples are {step:.4g} apart", True)
    if 0.0 < step < SLOWEST_STEP_S:
        return _doubted(values, step, 1.0, plain) or plain
    if step <= 0.0:
        return Factor(1.0, "s, as no unit is stated and samples have the same time", False)
    unit, factor = min(((u, f) for u, f in _SHORT.items() if u != "s"), key=lambda g: abs(np.log10(step * g[1]) + 3.0))
    return Factor(factor, f"{unit}, as samples are {step:.4g} apart", False)


def _doubted(values: Array, step: float, per_s: float, stated: Factor) -> Factor | None:
    """What has to be confirmed, where the samples would follow each other faster than those of any platform."""
    if not 0.0 < per_s * step < FASTEST_STEP_S:
        return None
    others = [
        f"{unit}: {factor:g}"
        for unit, factor in {**_SHORT, **_LONG}.items()
        if factor > per_s and FASTEST_STEP_S <= factor * step < SLOWEST_STEP_S
    ]
    other = f"; other units that would fit: {', '.join(others)}" if others else ""
    seen = f"{1.0 / (per_s * step):.3g} samples a second would be far more than a platform needs{other}"
    guess = DAY_S if is_excel_date(values) else per_s
    return Factor(guess, f"{stated.why}, but {seen}", False)
