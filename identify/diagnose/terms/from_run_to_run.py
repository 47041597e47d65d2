"""J, C and K fitted to every run by itself: a model that holds gives the same numbers in all of them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from identify.diagnose.low_passed_torque import NOISE_DRAWS
from identify.diagnose.terms.free_form import FreeForm
from identify.diagnose.torque_fit import TorqueFit
from identify.diagnose.torque_regression import TorqueRegression
from identify.model.parameters import Name
from identify.residual import FROM_RUN_TO_RUN
from identify.results import NORMAL_95
from rig.arrays import Array


def between_runs(regression: TorqueRegression, fit: TorqueFit) -> list[FreeForm]:
    """J, C and K of every run but the first, as differences from the first run's; nothing of a single run."""
    run, count = regression.run_of_each, len(regression.traces)
    columns = [column * (run == k) for k in range(1, count) for column in _own(regression, fit).values()]
    if not columns:
        return []
    none = np.zeros((0, len(columns)))
    made = partial(_made_by_noise_nm, regression, fit)
    return [
        FreeForm("time", np.stack(columns, axis=1), np.zeros(0), none, True, changes=FROM_RUN_TO_RUN, noise_nm=made)
    ]


def moved_on_average(
    regression: TorqueRegression, fit: TorqueFit, richer: TorqueFit, columns: Array, gains: Array
) -> Mapping[Name, float]:  # fmt: skip
    """By how much the average over the runs is another than the number of all runs together.

    A number of all runs together compares runs with each other: where one frequency tells K and another K - J w^2, a
    difference between them is J. The average takes what each run says by itself, weighted by how sure it is. Where the
    model holds both agree within their errors (Hausman, Econometrica 46, 1978); a smaller difference is none.
    """
    own = list(_own(regression, fit))
    names, covariance = regression.covariance_beside(richer, columns)
    first = np.array([richer.values[n] for n in own])
    differences = gains.reshape(-1, len(own))
    out: dict[Name, float] = {}
    for j, name in enumerate(own):
        here, values, variances = names.index(name), [], []
        for k in range(len(differences) + 1):
            row = np.zeros(len(covariance))
            row[here] = 1.0
            if k:
                row[len(names) + (k - 1) * len(own) + j] = 1.0
            values.append(first[j] + (differences[k - 1, j] if k else 0.0))
            variances.append(float(row @ covariance @ row))
        weights = np.array([1.0 / v if v > 0.0 else 0.0 for v in variances])
        if not np.sum(weights) > 0.0:
            continue
        moved = float(weights @ np.array(values) / np.sum(weights)) - fit.values[name]
        if abs(moved) > NORMAL_95 / np.sqrt(np.sum(weights)):
            out[name] = moved
    return out


def _own(regression: TorqueRegression, fit: TorqueFit) -> dict[Name, Array]:
    """The columns of J, C and K over all runs, (n,) each."""
    return {name: column for name, column in regression.columns_of(fit)[0].items() if len(name) == 1}


def _made_by_noise_nm(regression: TorqueRegression, fit: TorqueFit) -> float:
    """What numbers of each run's own explain under a model that holds, because the sensor's noise is in the motion.

    In a run of one sine, inertia and stiffness are nearly one number: what the noise adds to the acceleration is taken
    off again by a smaller inertia and a smaller stiffness. So noise is added to the motion once more, with the torque
    that the model takes along it as it was.
    """
    columns, free = regression.columns_of(fit)
    torque = sum(fit.values[name] * column for name, column in columns.items())
    run, own = regression.run_of_each, [name for name in columns if len(name) == 1]
    gained = []
    for seed in range(1, 1 + NOISE_DRAWS):
        draws = regression.motion_of_noise(seed)
        angle, rate, acceleration = (np.concatenate([d[k] for d in draws]) for k in range(3))
        noise = {"inertia": acceleration, "damping": rate, "stiffness": angle}
        noisy = {name: c + noise[str(name[0])] if name in own else c for name, c in columns.items()}
        rest = [c for name, c in noisy.items() if name not in own]
        together = np.column_stack([*(noisy[n] for n in own), *rest, free])
        apart = np.column_stack([*(noisy[n] * (run == k) for n in own for k in np.unique(run)), *rest, free])
        left = [torque - a @ np.linalg.lstsq(a, torque, rcond=None)[0] for a in (together, apart)]
        gained.append(np.mean(left[0] ** 2) - np.mean(left[1] ** 2))
    return float(np.sqrt(max(np.mean(gained), 0.0)))
