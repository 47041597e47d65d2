"""Values of undetermined parameters in the model: the declared ones, if the model reproduces the runs with them.

A single steady sine tells K - J w^2, and neither J nor K. The declared pair may contradict that, and the pair at
which a fit happens to stop means nothing. So each number that is not determined goes back to its declared value and
the rest is fitted beside it; where the runs are no longer replayed then, the fit's number stays.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from identify.estimate.final_fit import FinalFit
from identify.estimate.output_error import refine
from identify.model.parameters import Name
from identify.model.structure import Structure, shape_values
from identify.signals.trace import Trace
from rig import effects
from rig.platform import TERMS, Platform

DECLARED_FIT_ITERATIONS = 12  # steps of a fit with declared numbers held
MAX_CHI_SQUARE_RISE = 9.0  # three standard errors, by which a declared number does not contradict the runs


def declared_values(declared: Platform, torque_free: bool) -> dict[Name, float]:
    """The declared numbers as a fit names them; without torque per unit of the declared inertia."""
    scale = 1.0 / declared.inertia_kg_m2 if torque_free else 1.0
    jck = (declared.inertia_kg_m2, declared.damping_nm_s_rad, declared.stiffness_nm_rad)
    out: dict[Name, float] = {(t,): scale * v for t, v in zip(TERMS, jck, strict=True) if t in declared.terms}
    for name, given in declared.effects.items():
        effect = effects.get(name)
        for parameter, value in zip(effect.parameters, effect.values(given), strict=True):
            out[(name, parameter.name)] = value * (scale if effect.per_inertia(parameter) else 1.0)
    return out


def declared_shapes(declared: Platform, structure: Structure) -> dict[str, tuple[float, ...]]:
    """Shape parameters of the effects of a structure, as they were declared."""
    given = {
        n: zip(effects.get(n).parameters, effects.get(n).values(declared.effects[n]), strict=True)
        for n in structure.effects
    }
    return {n: shape_values(n, {p.name: value for p, value in pairs}) for n, pairs in given.items()}


def kept_as_declared(
    traces: Sequence[Trace], use: Sequence[Any], fitted: FinalFit, lost: Iterable[Name], declared: Mapping[Name, float]
) -> dict[Name, float]:
    """The values of a model, those of ``lost`` as declared where that replays the runs; others are fitted beside them.

    Far from the sensor's noise nothing says what replays the runs, and all stays as it was fitted.
    """
    asked = [name for name in lost if name in declared]
    values = dict(fitted.values)
    if not asked or not fitted.sensor_limited:
        return values
    held: list[Name] = [("inertia",)] if all(t.torque is None for t in traces) else []
    free = refine(traces, fitted.structure, values, None, DECLARED_FIT_ITERATIONS, use, fixed=held)
    for name in asked:
        start = {**values, name: declared[name]}
        trial = refine(traces, fitted.structure, start, None, DECLARED_FIT_ITERATIONS, use, fixed=[*held, name])
        if (trial.sigma**2 - free.sigma**2) * free.count < MAX_CHI_SQUARE_RISE * free.sigma**2:
            held.append(name)
            values = dict(trial.values)
    return values
