"""The likeliest noise beside a model that stays as it is: torque disturbance, walk and low-pass of the sensor.

A fit steps parameters and noise together, which is quick where both are near. Far off, the noise has long curved
valleys (less noise behind a gyro's low-pass, and all else more), and a step that is cut short for the one is cut short
for the other. Alone beside a linear platform, the noise needs no prediction: what other gains do to the innovations is
the same wherever the platform stands.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import minimize

from identify.likelihood.fit import Look
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.simulate.shots import RUNAWAY, Shots
from rig import effects
from rig.arrays import Array
from rig.dynamics.gains import Noise, innovations_with

if TYPE_CHECKING:
    from identify.likelihood.prediction_error import PredictionError

INFEASIBLE_COST = 1e300
LOG_STEP = 0.02  # of a logarithm, in differences
MAX_ITERATIONS = 20
GRADIENT_TOLERANCE = 1.0  # slope of the cost, a unit of a logarithm, at which it has arrived
INITIAL_BIAS_WALK = 1e-5  # of the rate, over a run
WHITE_SHARES = (1.0, 0.1, 0.01, 1e-3, 1e-4, 1e-5, 1e-6)  # of the torque, on the grid
COLOURED_SHARES, BESIDE = (0.3, 0.03, 0.003), (1.0, 0.05)  # of the torque, and times the best white beside them
LITTLE = 1e-6  # of the torque


def kinds_of_noise(problem: PredictionError, structure: Structure) -> list[str]:
    """The numbers of the noise that a model has; without a low-pass nothing is ahead of it."""
    out = ["white", "slow", "time_constant_s", "smooth"]
    if problem.gyro:
        out.append("walk")
        if any(effects.get(e).lag is not None for e in structure.effects):
            out.append("ahead")
    elif problem.wanders:
        out += ["walk", "walk_s"]
    return out


def noise_on_grid(problem: PredictionError, cost: Callable[[Noise], float], smooth: Sequence[bool]) -> Noise:
    """The best of a coarse grid of noises: white alone first, then a coloured part beside it, rough or smooth."""
    p = problem
    times_s = np.geomspace(20.0 * p.step_s, 0.3 * p.slowest_s, 3).tolist()
    gyro = (p.walk(INITIAL_BIAS_WALK), p.step_s, np.inf if p.gyro else 30.0 * p.step_s)
    little = p.slow(LITTLE)

    def of(white: float, coloured: float, time_s: float, is_smooth: bool = True) -> Noise:
        slow, also = (little, coloured) if is_smooth else (coloured, little)
        return p.within(Noise(white, slow, time_s, *gyro, also))

    best = min((of(p.white(share), little, times_s[1]) for share in WHITE_SHARES), key=cost)
    coloured = [
        of(best.white * w, p.slow(share), t, which)
        for which in smooth for t in times_s for share in COLOURED_SHARES for w in BESIDE
    ]  # fmt: skip
    return min((best, *coloured), key=cost)


@RUNAWAY
def likeliest_noise(
    problem: PredictionError, structure: Structure, names: Sequence[Name], x: Array, shots: Sequence[Shots],
    looks: Sequence[Look], weights: Sequence[Any], noise: Noise, kinds: Sequence[str],
) -> Noise:  # fmt: skip
    """From the noise that ``looks`` were predicted with down to the nearest minimum.

    Parameters
    ----------
    kinds
        Numbers of the noise that this model has.
    """
    count = int(sum(w.sum() for w in weights)) * problem.readings
    begun = np.log([getattr(noise, kind) for kind in kinds])

    def of(logs: Array) -> Noise:
        return problem.within(replace(noise, **dict(zip(kinds, np.exp(logs).tolist(), strict=True))))

    def cost(logs: Array) -> float:
        there = of(logs)
        squares = spread = 0.0
        for s, q, w in zip(shots, looks, weights, strict=True):
            gains = problem.gains_at(s, structure, names, x, there)
            spans = [(a, b - 1) for a, b in s.edges]
            if structure.bends:
                e = problem.look(s, structure, names, x, there, gains).innovations[w]
            else:
                e = innovations_with(q.gains, gains, q.innovations, q.state, s.trace.keep, spans)[w]
            v = gains.variance[w]
            squares += float(np.sum(e * e / v))
            spread += float(np.sum(np.log(v)))
        variance, _ = problem.variance_of(squares, count)
        value = count * (np.log(variance) - 1.0) + squares / variance + spread
        return float(value) if np.isfinite(value) else INFEASIBLE_COST

    found = minimize(
        cost, begun, method="BFGS", options={"maxiter": MAX_ITERATIONS, "gtol": GRADIENT_TOLERANCE, "eps": LOG_STEP}
    )
    return of(found.x)
