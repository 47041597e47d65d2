"""One final fit as the tables show it: parameters with intervals, what is not determined, what replays the runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from identify.bounds.jumps import why_of_a_jump
from identify.bounds.undetermined import of_another_run, open_phases, undetermined
from identify.conclude.case import Case, runs_fitted
from identify.conclude.declared_values import declared_values, kept_as_declared
from identify.conclude.error_figures import Measured
from identify.estimate.final_fit import FinalFit
from identify.model.parameters import Name, platform_of
from identify.results import UNITS, ModelResult, NotReported, ParameterEstimate
from identify.wording import on_axis
from rig import effects
from rig.platform import Platform

TORQUE_FREE = {"damping": ("damping_over_inertia", "1/s"), "stiffness": ("stiffness_over_inertia", "1/s^2")}


def model_of(case: Case, fitted: FinalFit, measured: Measured, dropped: tuple[NotReported, ...]) -> ModelResult:
    """What a fit tells of its model: numbers with intervals, errors, and what is not determined."""
    parameters: dict[str, ParameterEstimate] = {}
    of_effects: dict[str, dict[str, ParameterEstimate]] = {
        effects.first_of(e): {} for e in fitted.structure.effects
    }  # fmt: skip
    lost, open_ = _lost(case, fitted), open_phases(fitted)
    for name in fitted.names:
        if name in lost or of_another_run(name, runs_fitted(case)):
            continue
        value, error = fitted.values[name], open_.get(name, fitted.reported_error(name))
        estimate = ParameterEstimate.normal(value, error, _unit(case, name))
        if len(name) == 1:
            parameters[_label(case, name)] = estimate
        else:
            key = name[1] if len(name) == 2 else f"{name[1]}_run_{int(name[2]) + 1}"
            first = effects.first_of(name[0])
            of_effects[first][key if first == name[0] else f"{key}_{name[0].removeprefix(first + '_')}"] = estimate
    missing = tuple(NotReported(_label(case, name), why) for name, why in lost.items())
    platform = _platform(case, fitted, fitted.values)
    return ModelResult(parameters, of_effects, measured.errors, dropped, missing, _correlation(fitted), platform)


def _platform(case: Case, fitted: FinalFit, values: Mapping[Name, float]) -> Platform:
    """As it stood in the first run that a fit looked at."""
    run = min(runs_fitted(case), default=0)
    return platform_of(fitted.structure, tuple(values), np.array(list(values.values())), run)


def _lost(case: Case, fitted: FinalFit) -> dict[Name, str]:
    alone = len(case.traces) == 1 and case.disturbance is None  # a measured run is no single tone
    lost = undetermined(fitted, runs_fitted(case), alone)
    return {name: why_of_a_jump(fitted, name, case.traces) or why for name, why in lost.items()}


def _label(case: Case, name: Name) -> str:
    """As the tables call a parameter."""
    if len(name) > 1:
        return ".".join(name)
    return TORQUE_FREE[name[0]][0] if case.torque_free else name[0]


def _unit(case: Case, name: Name) -> str:
    if len(name) == 1:
        return TORQUE_FREE[name[0]][1] if case.torque_free else UNITS[case.recording.axis][name[0]]
    effect = effects.get(name[0])
    parameter = next(p for p in effect.parameters if p.name == name[1])
    unit = parameter.unit + ("/(kg*m^2)" if case.torque_free and effect.per_inertia(parameter) else "")
    return on_axis(unit, case.recording.axis)


def to_build_on(case: Case, fitted: FinalFit, model: ModelResult) -> ModelResult:
    """The final model with declared numbers where the data say nothing, as far as it replays the runs with them."""
    lost, declared = _lost(case, fitted), declared_values(case.declared, case.torque_free)
    values = kept_as_declared(case.traces, case.split.final, fitted, lost, declared)
    missing = tuple(
        replace(parameter, as_declared=name in declared and values[name] == declared[name])
        for name, parameter in zip(lost, model.not_determined, strict=True)
    )
    return replace(model, not_determined=missing, platform=_platform(case, fitted, values))


def _correlation(fitted: FinalFit) -> dict[str, float]:
    size = np.sqrt(np.maximum(np.diag(fitted.covariance), 1e-300))
    if not np.all(np.isfinite(fitted.covariance)):
        return {}
    out = {}
    for i in range(len(fitted.names)):
        for k in range(i):
            value = float(fitted.covariance[i, k] / (size[i] * size[k]))
            if abs(value) > 0.9:
                out[f"{'.'.join(fitted.names[k])}, {'.'.join(fitted.names[i])}"] = value
    return out
