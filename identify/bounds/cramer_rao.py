"""What planned or recorded runs can and cannot determine, from their information matrix (Cramer-Rao).

Each run is simulated at a platform, the sensitivities of the measured channel are taken as for the fit
itself, and what the start angle, the start rate and the gyro's bias could explain is projected out. What is
left, over the variance of the sensor's noise, is the information: its inverse bounds the covariance of every
unbiased estimate (Ljung, System Identification, 2nd ed., section 7.4). Information of several runs adds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from identify.model.parameters import Name, names_of
from identify.model.structure import Structure
from identify.signals.trace import UPSAMPLING, Trace
from identify.simulate.sensitivities import INFORMATION_RCOND, nuisance_basis, sensitivities
from identify.simulate.shots import make_shots
from rig import effects
from rig.dynamics import Equations, TorqueSignal, simulate
from rig.dynamics.equations import MAX_SUBSTEPS
from rig.excitation import PlannedSet
from rig.platform import Platform
from rig.recording.run import Array, Run

DELAY = "torque_delay"


@dataclass(frozen=True)
class Information:
    """What one run, or several together, tell about the parameters of a structure.

    Attributes
    ----------
    matrix
        Shape (p, p), per noise variance, start states and bias eliminated: its inverse is the bound.
    known
        The same with start states and bias known.
    energy, count
        Sum of squares of the motion in the measured channel over the noise variance, and samples that count.
    misfit
        Shape (p, p): the matrices of all runs, each times its energy. What a model leaves of a run is a share of
        that run's motion.
    torque_free
        No torque was measured: only ratios to the inertia show, and inertia is not among ``names``.
    """

    name: str
    names: tuple[Name, ...]
    values: Array
    matrix: Array
    known: Array
    misfit: Array
    energy: float
    count: int
    frequency_hz: float | None = None
    torque_free: bool = False

    def __add__(self, other: Information) -> Information:
        """Both together."""
        return replace(
            self, name=f"{self.name} + {other.name}", matrix=self.matrix + other.matrix,
            known=self.known + other.known, misfit=self.misfit + other.misfit,
            energy=self.energy + other.energy, count=self.count + other.count,
            frequency_hz=None, torque_free=self.torque_free and other.torque_free,
        )  # fmt: skip

    @cached_property
    def _axes(self) -> tuple[Array, Array, Array]:
        length = np.sqrt(np.maximum(np.diag(self.matrix), 0.0))
        length = np.where(length > 0.0, length, 1.0)
        scaled = self.matrix / np.outer(length, length)
        # A model that runs away tells nothing of any parameter.
        power, axes = np.linalg.eigh(scaled if np.all(np.isfinite(scaled)) else np.zeros_like(scaled))
        return length, power, axes

    @property
    def _empty(self) -> Array:
        power = self._axes[1]
        return np.asarray(power <= INFORMATION_RCOND * max(float(power[-1]), 1e-300))

    @property
    def rank(self) -> int:
        """How many combinations of the parameters show at all."""
        return int(np.sum(np.logical_not(self._empty)))

    @property
    def condition(self) -> float:
        """Largest over smallest singular value of the sensitivities, each scaled to unit length."""
        power = self._axes[1]
        return float(np.sqrt(power[-1] / power[0])) if self.rank == len(power) else np.inf

    @cached_property
    def _inverse(self) -> tuple[Array, Array]:
        """Inverse of the matrix without its empty directions, and which parameters these touch."""
        length, power, axes = self._axes
        inverse = (axes / np.where(self._empty, np.inf, power)) @ axes.T / np.outer(length, length)
        return inverse, np.any(np.abs(axes[:, self._empty]) > 1e-3, axis=1)

    @cached_property
    def covariance(self) -> Array:
        """The Cramer-Rao bound, (p, p); infinite variance for what an empty direction touches."""
        inverse, touched = self._inverse
        out = inverse.copy()
        out[touched, touched] = np.inf
        return out

    @property
    def correlation(self) -> Array:
        """Correlation of the estimates, (p, p)."""
        length, power, axes = self._axes
        kept = np.maximum(power, INFORMATION_RCOND * max(float(power[-1]), 1e-300))
        inverse = (axes / kept) @ axes.T / np.outer(length, length)
        size = np.sqrt(np.diag(inverse))
        return np.asarray(inverse / np.outer(size, size))

    def std_error(self, name: Name) -> float:
        """Expected standard error of a parameter, in its unit; infinite where nothing determines it."""
        i = self.names.index(name)
        return float(np.sqrt(self.covariance[i, i]))

    def relative(self, name: Name) -> float:
        """Expected standard error over the value; infinite for a parameter that is zero."""
        value = abs(float(self.values[self.names.index(name)]))
        return self.std_error(name) / value if value > 0.0 else np.inf

    @property
    def loudness(self) -> float:
        """Root mean square of the motion over the sensor's noise."""
        return float(np.sqrt(self.energy / max(self.count, 1)))

    def amplification(self, name: Name) -> float:
        """Relative error of a parameter per relative error of the model, at the worst.

        About one where the parameter shapes the whole motion. At a thousand, a thousandth of each run's motion
        that the model does not explain can move the parameter by all of its value, however quiet the sensor.
        """
        i = self.names.index(name)
        inverse, touched = self._inverse
        value = abs(float(self.values[i]))
        if touched[i] or value == 0.0:
            return np.inf
        return float(np.sqrt(inverse[i] @ self.misfit @ inverse[i])) / value

    def without(self, name: Name) -> Information:
        """The same where one parameter is known."""
        kept = [i for i, n in enumerate(self.names) if n != name]
        table = np.ix_(kept, kept)
        return replace(
            self, names=tuple(self.names[i] for i in kept), values=self.values[kept],
            matrix=self.matrix[table], known=self.known[table], misfit=self.misfit[table],
        )  # fmt: skip

    def if_known(self) -> Information:
        """The same with start states and bias known."""
        return replace(self, matrix=self.known)


def with_delay(platform: Platform) -> Platform:
    """The platform with a torque delay of zero among its parameters, unless it has one."""
    if DELAY in platform.effects:
        return platform
    return replace(platform, effects={**platform.effects, DELAY: {"delay": 0.0}})


def planned_trace(
    platform: Platform, planned: PlannedSet, sample_rate_hz: float, noise: float, number: int = 0,
    channel: Literal["rate", "angle"] = "rate",
) -> Trace:  # fmt: skip
    """A planned set as the fit would see it, played from rest on ``platform``, its sensor free of noise."""
    time = np.arange(round(planned.duration_s * sample_rate_hz) + 1) / sample_rate_hz
    torque = TorqueSignal(time, np.asarray(planned.torque(time), dtype=float))
    motion = simulate(platform, time, torque)
    sees_rate = channel == "rate"
    run = Run(
        planned.name, time, np.ones(len(time), dtype=bool),
        rate_rad_s=motion.sensed_rate_rad_s if sees_rate else None, angle_rad=None if sees_rate else motion.angle_rad,
        torque_time_s=time, torque_nm=torque.torque_nm, frequency_hz=planned.frequency_hz,
    )  # fmt: skip
    from identify.signals.prepare import prepare  # noqa: PLC0415  slow to load: no forecast needs it

    return prepare(run, number, noise, lead_in_s=0.0)


def _forecast_trace(platform: Platform, planned: PlannedSet, sample_rate_hz: float, noise: float, number: int) -> Trace:
    """The same behind a gyro, where nothing is to be found out about the record: its motion is known as simulated."""
    count = round(planned.duration_s * sample_rate_hz) + 1
    time, fine = (
        np.arange(count) / sample_rate_hz,
        np.arange((count - 1) * UPSAMPLING + 1) / sample_rate_hz / UPSAMPLING,
    )
    torque = TorqueSignal(time, np.asarray(planned.torque(time), dtype=float))
    motion = simulate(platform, fine, torque)
    rate = motion.sensed_rate_rad_s
    run = Run(
        planned.name, time, np.ones(count, dtype=bool), rate_rad_s=rate[::UPSAMPLING], torque_time_s=time,
        torque_nm=torque.torque_nm, frequency_hz=planned.frequency_hz,
    )  # fmt: skip
    return Trace(
        run, "rate", 1.0 / sample_rate_hz, rate[::UPSAMPLING], np.ones(count, dtype=bool), [(0, count - 1)], torque,
        noise, 0.5 * sample_rate_hz, number, motion=(motion.angle_rad, rate, fine, torque.at(fine), 0.0),
    )  # fmt: skip


def vector_of(platform: Platform, runs: int) -> tuple[Structure, tuple[Name, ...], Array]:
    """Structure, names and values of all parameters of a platform."""
    structure = Structure(platform.terms, tuple(platform.effects))
    terms = {
        "inertia": platform.inertia_kg_m2, "damping": platform.damping_nm_s_rad, "stiffness": platform.stiffness_nm_rad
    }  # fmt: skip
    names = names_of(structure, runs)
    held = {name: _by_name(name, given) for name, given in platform.effects.items()}
    return structure, names, np.array([terms[n[0]] if len(n) == 1 else held[n[0]][n[1]] for n in names])


def _by_name(name: str, given: Mapping[str, float]) -> dict[str, float]:
    effect = effects.get(name)
    return dict(zip((p.name for p in effect.parameters), effect.values(given), strict=True))


def information_of(
    trace: Trace, platform: Platform, runs: int = 1, start: tuple[float, float] | None = None
) -> Information:
    """What one run tells about every parameter of a platform.

    Parameters
    ----------
    runs
        How many runs share the parameters (some effects hold one value a run).
    start
        Angle in rad and rate in rad/s at the first sample; None takes them from the trace.
    """
    structure, names, values = vector_of(platform, runs)
    equations = Equations(platform)
    shots = make_shots(trace, min(MAX_SUBSTEPS, equations.substeps(trace.step_s)), None, None, equations)
    if start is not None:
        shots.starts = np.tile(np.array(start, dtype=float), (len(shots.first), 1))
    free = trace.torque is None or not np.any(trace.torque.torque_nm)
    fixed = np.array([free and n == ("inertia",) for n in names])
    scale = np.where(values != 0.0, np.abs(values), 1.0)
    columns, state, _ = sensitivities(shots, structure, names, values, scale, fixed)
    used = shots.weight
    bare = columns[used][:, ~fixed] / trace.noise
    basis = nuisance_basis(shots, state)
    clean = bare - basis @ (basis.T @ bare)
    motion = trace.measured[used] / trace.noise
    kept = tuple(n for n, out in zip(names, fixed, strict=True) if not out)
    matrix, energy = clean.T @ clean, float(motion @ motion)
    return Information(
        trace.run.name, kept, values[~fixed], matrix, bare.T @ bare, energy * matrix, energy, len(motion),
        trace.run.frequency_hz, free,
    )  # fmt: skip


def of_planned(
    platform: Platform, sets: Sequence[PlannedSet], sample_rate_hz: float, noise_rad_s: float
) -> tuple[Information, ...]:
    """What each planned set alone would tell about a platform, each played from rest."""
    traces = [_forecast_trace(platform, s, sample_rate_hz, noise_rad_s, i) for i, s in enumerate(sets)]
    return tuple(information_of(t, platform, len(traces), (0.0, 0.0)) for t in traces)


def together(several: Sequence[Information]) -> Information:
    """All of them together."""
    total = several[0]
    for one in several[1:]:
        total = total + one
    return replace(total, name="all sets together")
