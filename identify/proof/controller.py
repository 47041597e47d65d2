"""The compensation for a controller: what of a model is a function of angle, rate and torque, and where it holds."""

from __future__ import annotations

import hashlib
import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identify.proof.compensation import SOFT
from identify.signals.noise import noise_of
from rig import effects
from rig.arrays import Array
from rig.config.model import model_yaml
from rig.effects.base import Place
from rig.errors import UsageError
from rig.platform import Platform
from rig.recording.run import Recording, Run

VERSION_DIGITS = 12  # hexadecimal digits of the model's SHA-256
NOISES = 3.0  # of the sensor: a rate below is no direction
TABLE_GRID_POINTS = 41  # values of angle and of rate in the table


@dataclass(frozen=True)
class Term:
    """One effect in the function: its expression (see ``Effect.formula``) and the numbers in it by name."""

    effect: str
    expression: str
    numbers: Mapping[str, float]
    is_friction: bool


@dataclass(frozen=True)
class Controller:
    """A compensating torque as a function of angle, rate and torque.

    Parameters
    ----------
    left_out
        Effects of the model that are no such function, and why.
    most_angle_rad, most_rate_rad_s
        The largest that the recording shows: beyond it the function stays at its value there.
    most_torque_nm
        The limit of the rig: the function never exceeds it.
    soft_rate_rad_s
        Below it the sign of the rate is in proportion to it.
    version
        Of the model: the first digits of the SHA-256 of its values as a model.yaml has them.
    """

    terms: tuple[Term, ...]
    left_out: Mapping[str, str]
    most_angle_rad: float
    most_rate_rad_s: float
    most_torque_nm: float
    soft_rate_rad_s: float
    version: str


def controller_of(model: Platform, recording: Recording, most_torque_nm: float) -> Controller:
    """The function that a model stands for.

    Raises
    ------
    UsageError
        Where no effect of the model is a function of angle, rate and torque.
    """
    terms, left_out = [], {}
    for name in model.effects:
        if (term := term_of(model, name)) is not None:
            terms.append(term)
        else:
            left_out[name] = _why_not(name)
    if not terms:
        reasons = "; ".join(f"{name}: {why}" for name, why in left_out.items()) or "it has none"
        raise UsageError(f"no effect of this model is a function of angle, rate and torque: {reasons}")
    angle, rate = _reach(recording.runs)
    soft = soft_rate_of(recording)
    return Controller(tuple(terms), left_out, angle, rate, most_torque_nm, soft, version_of(model))


def term_of(model: Platform, name: str) -> Term | None:
    """One effect of a model as an expression with its numbers; None where it is no function of angle and rate."""
    effect = effects.get(name)
    if not effect.formula:
        return None
    by_key = {p.key: float(v) for p, v in zip(effect.parameters, effect.values(model.effects[name]), strict=True)}
    known = by_key | {"stiffness_nm_rad": float(model.stiffness_nm_rad)}
    used = {k: v for k, v in known.items() if re.search(rf"\b{k}\b", effect.formula)}
    return Term(name, effect.formula, used, effect.place is Place.FRICTION)


def version_of(model: Platform) -> str:
    """The first digits of the SHA-256 of a model's values as a model.yaml has them."""
    return hashlib.sha256(model_yaml(model).encode()).hexdigest()[:VERSION_DIGITS]


def soft_rate_of(recording: Recording) -> float:
    """The rate in rad/s below which a recording does not tell the direction of the motion."""
    noise = min((_rate_noise(run) for run in recording.runs), default=0.0)
    return max(SOFT * _reach(recording.runs)[1], NOISES * noise)


def _why_not(name: str) -> str:
    effect = effects.get(name)
    if effect.place is Place.SENSOR:
        return "it changes the measurement, not the motion"
    if effect.inverse is not None:
        return "its compensation inverts the drive's dynamics, which requires the future torque command"
    if effect.states:
        return "it has memory: its torque depends on past motion"
    return effect.stays or "it depends on other quantities"


def _reach(runs: Sequence[Run]) -> tuple[float, float]:
    """Largest angle from rest in rad and largest rate in rad/s that a recording shows."""
    angle = rate = 0.0
    for run in runs:
        ok = run.valid
        if run.rate_rad_s is not None and np.any(ok):
            turned = np.where(ok & np.isfinite(run.rate_rad_s), run.rate_rad_s, 0.0)
            rate = max(rate, float(np.max(np.abs(turned))))
            if run.angle_rad is None:
                angle = max(angle, _integrated(run.time_s, turned))
        if run.angle_rad is not None and np.any(ok):
            at = run.angle_rad[ok & np.isfinite(run.angle_rad)]
            angle = max(angle, float(np.max(np.abs(at), initial=0.0)))
            if run.rate_rad_s is None:
                rate = max(rate, float(np.max(np.abs(np.gradient(run.angle_rad[ok], run.time_s[ok])))))
    return angle, rate


def _integrated(time_s: Array, rate_rad_s: Array) -> float:
    """Largest angle of a gyro's integral, less the line that its bias makes of it where that is less."""
    steps = np.diff(time_s)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (rate_rad_s[1:] + rate_rad_s[:-1]) * steps)])
    line = np.polynomial.Polynomial.fit(time_s, angle, 1)
    return float(min(np.max(np.abs(angle)), np.max(np.abs(angle - line(time_s)))))


def _rate_noise(run: Run) -> float:
    return noise_of(run.rate_rad_s[run.valid]) if run.rate_rad_s is not None and np.sum(run.valid) > 16 else 0.0


def value(controller: Controller, angle_rad: float, rate_rad_s: float, torque_nm: float = 0.0) -> float:
    """The compensating torque in N m, by the same expressions as the exported functions."""
    angle = min(max(angle_rad, -controller.most_angle_rad), controller.most_angle_rad)
    rate = min(max(rate_rad_s, -controller.most_rate_rad_s), controller.most_rate_rad_s)
    direction = min(max(rate / controller.soft_rate_rad_s, -1.0), 1.0)
    known = {
        "angle_rad": angle, "rate_rad_s": rate, "torque_nm": torque_nm, "sin": math.sin, "cos": math.cos,
        "exp": math.exp, "fabs": math.fabs, "fmin": min, "fmax": max,
    }  # fmt: skip
    total = 0.0
    for term in controller.terms:
        made = float(eval(term.expression, {"__builtins__": {}}, known | dict(term.numbers)))
        total += direction * made if term.is_friction else made
    return min(max(total, -controller.most_torque_nm), controller.most_torque_nm)


def table_of(controller: Controller) -> list[tuple[float, float, float]]:
    """Rows of angle in rad, rate in rad/s and compensating torque in N m, without torque on the shaft."""
    angles = np.linspace(-controller.most_angle_rad, controller.most_angle_rad, TABLE_GRID_POINTS).tolist()
    rates = np.linspace(-controller.most_rate_rad_s, controller.most_rate_rad_s, TABLE_GRID_POINTS).tolist()
    return [(a, w, value(controller, a, w)) for a, w in itertools.product(angles, rates)]
