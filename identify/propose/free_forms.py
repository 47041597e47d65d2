"""Free-form torques as candidates: over which range of the motion each is tried, its score, and its fit.

The range is that of the states the model predicts, not of the measured motion: where a gyro alone is read, an angle
integrated from it drifts out of any range.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.effect_torque import torque_along
from identify.model.parameters import Name, equations_of
from identify.propose.innovation_score import InnovationScores, Score
from rig import effects
from rig.arrays import Array
from rig.effects.base import Place, Scale

CURVE_EDGE_QUANTILE = 0.005  # share of the samples beyond either end of a curve, which goes straight on there
FASTEST_MEMORY = 0.1  # of the time in which the motion turns by a radian

Range = tuple[float, float]


def states_of(problem: PredictionError, fit: Fit) -> list[Array]:
    """Angle, rate and slow torque after every sample, (n, 3), one array a run."""
    return [
        problem.look(s, fit.structure, fit.names, fit.vector, fit.noise).state for s in fit.shots
    ]  # fmt: skip


def shaft_torque_of(fit: Fit) -> list[Array]:
    """Torque behind the drive at every sample, (n,), one array a run: what is passed on, where the drive clips."""
    out: list[Array] = []
    for s in fit.shots:
        equations = equations_of(fit.structure, fit.names, fit.vector, s.number, s.added)
        begins, ends = s.grid.shaft_torque(equations)[:, 0], s.grid.shaft_torque(equations)[-1:, 2]
        out.append(np.ascontiguousarray(np.concatenate([begins, ends])[:: round(s.trace.step_s / s.grid.step_s)]))
    return out


def ranges(problem: PredictionError, fit: Fit) -> dict[str, Range]:
    """Where the curve of every free form begins and ends."""
    states = np.concatenate(states_of(problem, fit))
    angle, rate = states[:, 0], states[:, 1]
    torque = np.concatenate(shaft_torque_of(fit))
    # What is measured ahead of a cut stretch holds no curve: whatever it did there has died away by the first sample.
    first_s = min(s.trace.since_start_s + float(np.argmax(s.weight)) * s.trace.step_s for s in fit.shots)
    last_s = max(s.trace.since_start_s + (len(s.weight) - 1) * s.trace.step_s for s in fit.shots)
    time = (first_s, last_s)
    turning = float(np.sqrt(np.mean(rate**2) / max(float(np.var(angle)), 1e-300)))

    def inner(values: Array) -> Range:
        low, high = np.quantile(values, [CURVE_EDGE_QUANTILE, 1.0 - CURVE_EDGE_QUANTILE])
        return float(low), float(high)

    over = {"rad": inner(angle), "rad/s": inner(rate), "N*m": inner(torque), "s": time}
    out = {name: over[effect.parameters[0].unit] for name, effect in effects.free_forms().items()}
    out["free_gain_over_speed"] = (0.0, inner(np.abs(rate))[1])
    out["free_memory"] = (FASTEST_MEMORY / max(turning, 1e-300), 0.0)
    return {n: r for n, r in out.items() if r[0] != r[1]}


def scores(problem: PredictionError, fit: Fit, scale: Scale, allowed: Sequence[str]) -> list[Score]:
    """What every free form could take of what a model predicts wrongly, the largest gain first."""
    tests = InnovationScores(problem, fit, scale)
    if tests.lost:
        return []
    at = ranges(problem, fit)
    names = [n for n in allowed if n in at and not (problem.torque_free and "torque" in n)]
    with np.errstate(all="ignore"):
        found = problem.workers.each(lambda n: tests.score(effects.get(n), at[n]), names)
        return sorted((s for s in found if s is not None), key=lambda s: -s.gain)


def fitted(problem: PredictionError, now: Fit, form: Score, steps: int, least: float = np.inf) -> Fit:
    """A model with a free form beside it, or in the place of the friction that it contains.

    ``least`` is the cost that it must be below after a few steps to be followed to its end.
    """
    effect = effects.get(form.effect)
    held = [e for e in now.structure.effects if e in effect.nests]
    structure = now.structure
    for name in held:
        structure = structure.minus(name)
    start: dict[Name, float] = {k: v for k, v in now.values.items() if k[0] not in held}
    level = sum(now.values.get((e, p.name), 0.0) for e in held for p in effects.get(e).parameters if p.linear)
    shape = iter(form.shape)
    for p in effect.parameters:
        start[(effect.name, p.name)] = level if p.linear else next(shape)
    return problem.fit(
        structure.plus(effect.name), start, now.noise, steps, carry=now.shots, thorough=False, against=now.cost,
        least=least,
    )  # fmt: skip


def torque_of(problem: PredictionError, fit: Fit, name: str) -> list[Array]:
    """What an effect or a free form of a fit resists with along the motion that it predicts, (n,), one array a run."""
    effect = effects.get(name)
    out: list[Array] = []
    for trace, states, torque in zip(problem.traces, states_of(problem, fit), shaft_torque_of(fit), strict=True):
        n = len(states)
        p = np.array([0.0, 0.0, 0.0, *(fit.values[(name, q.name)] for q in effect.parameters)])
        angle, rate = np.ascontiguousarray(states[:, 0]), np.ascontiguousarray(states[:, 1])
        z = np.array(
            effect.rest_state(angle[0], rate[0]) if effect.rest_state else np.zeros(effect.states), dtype=float
        )
        along, time = np.zeros(n), trace.since_start_s + np.arange(n) * trace.step_s
        torque_along(
            effect.kernel.address, angle, rate, time, torque, trace.step_s, z, 4, p,
            effect.place is Place.FRICTION, max(2.0 * trace.fine[4], 1e-12), along,
        )  # fmt: skip
        out.append(along)
    return out
