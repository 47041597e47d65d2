"""How far an excitation would part two models that the data so far leave alike.

One model is taken for the truth and simulated from rest; the other is fitted to it as the identifier would: its start
state, the sensor's bias and all of its parameters move as they like, at the price that the data so far put on
moving them (their information matrix). What chi square is left is the separation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from identify.bounds.cramer_rao import Information, information_of, planned_trace, vector_of
from identify.model.parameters import bounds_of, is_gain, ordered, platform_of
from identify.signals.trace import Trace
from identify.simulate.sensitivities import nuisance_basis, sensitivities
from identify.simulate.shots import RUNAWAY, Shots, make_shots
from rig.dynamics import Equations
from rig.dynamics.equations import MAX_SUBSTEPS
from rig.excitation import PlannedSet
from rig.platform import Platform
from rig.recording.run import Array

SEPARATION_ROUNDS = 8  # rounds in which a model is fitted to what the other would have shown
MAX_SHORTER_STEPS = 5  # of a step, each shorter than the one before
MIN_ROUND_GAIN = 0.05  # of chi square by which a round has to gain
STARTS = (1.0, 0.1, 0.0)  # of the gains of the model's own effects


@dataclass(frozen=True)
class Sensor:
    """What reads the motion: how often, which channel, with how much noise (one standard deviation a sample)."""

    sample_rate_hz: float
    noise: float
    channel: Literal["rate", "angle"] = "rate"


@dataclass(frozen=True)
class Imitation:
    """One of two directions: ``truth`` makes the data, ``model`` tries to pass for it.

    ``prior`` is what the data so far tell about the model's parameters, (p, p), per noise variance; parameters with a
    value of their own in each run are free and stand in no prior.
    """

    truth: Platform
    model: Platform
    prior: Array


@dataclass(frozen=True)
class Share:
    """What one excitation adds: squares of the difference, its product with the sensitivities, their information."""

    squares: float
    gradient: Array
    information: Array

    def __add__(self, other: Share) -> Share:
        """Both excitations together."""
        return Share(self.squares + other.squares, self.gradient + other.gradient, self.information + other.information)

    def left(self, prior: Array) -> float:
        """Chi square left when the parameters have taken up what pays, to first order."""
        return self.squares - float(self.gradient @ self.step(prior))

    def step(self, prior: Array, moved: Array | None = None, damping: float = 0.0) -> Array:
        """The move of the parameters that leaves the least, from where they have ``moved`` already."""
        total = self.information + prior
        gradient = self.gradient if moved is None else self.gradient - prior @ moved
        size = np.sqrt(np.maximum(np.diag(total), 1e-300))
        if not np.all(np.isfinite(total)):
            return np.zeros(len(size))
        scaled = total / np.outer(size, size) + damping * np.eye(len(size))
        return np.asarray(np.linalg.lstsq(scaled, gradient / size, rcond=1e-13)[0] / size)


def prior_of(platform: Platform, traces: Sequence[Trace], noise: float) -> Array:
    """What recorded runs tell about a platform's parameters, (p, p), with this noise; zero where nothing is known."""
    runs = 1 + max(t.number for t in traces)
    with np.errstate(all="ignore"):
        each = [information_of(t, platform, runs) for t in traces]
    total = sum((one.matrix * (t.noise / noise) ** 2 for one, t in zip(each, traces, strict=True)), np.zeros(()))
    return _shared(each[0], np.asarray(total))


def _shared(one: Information, total: Array) -> Array:
    """The information on what all runs share, what belongs to single runs eliminated."""
    kept = [i for i, n in enumerate(one.names) if len(n) < 3]
    loose = [i for i, n in enumerate(one.names) if len(n) == 3]
    if not np.all(np.isfinite(total)):
        return np.zeros((len(kept), len(kept)))
    matrix = total[np.ix_(kept, kept)]
    if loose:
        across = total[np.ix_(kept, loose)]
        matrix = matrix - across @ np.linalg.pinv(total[np.ix_(loose, loose)], hermitian=True) @ across.T
    return np.asarray(matrix)


def measured(truth: Platform, planned: PlannedSet, sensor: Sensor) -> Trace:
    """What the sensor would show of a set if ``truth`` were the platform, without noise."""
    return planned_trace(truth, planned, sensor.sample_rate_hz, sensor.noise, 0, sensor.channel)


def shots_of(model: Platform, trace: Trace) -> Shots:
    """A set as the simulator sees it, from rest, on steps fine enough for a model."""
    equations = Equations(model)
    shots = make_shots(trace, min(MAX_SUBSTEPS, equations.substeps(trace.step_s)), None, None, equations)
    shots.starts = np.zeros((len(shots.first), 2))
    return shots


@RUNAWAY
def share_of(model: Platform, shots: Shots) -> Share:
    """How a model differs from what a set showed, start state and bias projected out."""
    structure, names, values = vector_of(model, 1)
    scale = np.where(values != 0.0, np.abs(values), 1.0)
    columns, state, residual = sensitivities(shots, structure, names, values, scale, np.zeros(len(names), dtype=bool))
    used: Any = shots.weight
    kept = [i for i, n in enumerate(names) if len(n) < 3]
    loose = [i for i, n in enumerate(names) if len(n) == 3]
    both = np.column_stack([columns[used][:, kept], residual[used]]) / shots.trace.noise
    if not (np.all(np.isfinite(both)) and np.all(np.isfinite(state[used]))):
        return Share(0.0, np.zeros(len(kept)), np.zeros((len(kept), len(kept))))  # it runs away: no ground to stand on
    basis = nuisance_basis(shots, state)
    if loose:
        basis = np.linalg.qr(np.column_stack([basis, columns[used][:, loose]]))[0]
    clean = both - basis @ (basis.T @ both)
    gram = clean.T @ clean
    return Share(float(gram[-1, -1]), gram[:-1, -1], gram[:-1, :-1])


def settled(
    imitation: Imitation, several: Sequence[PlannedSet], sensor: Sensor, weight: float = 1.0, least: float = 0.0
) -> float:  # fmt: skip
    """Chi square that several sets leave when the model is fitted to what the truth would have shown.

    Each sample counts ``weight`` times. The fit follows the bend (Levenberg-Marquardt, sensitivities anew after each
    move), and begins once more with little of the model's own effects: a gain that the data so far hardly know may
    be far off, and the way back from there leads over hills. Below ``least`` it does not look any further.
    """
    sensor = replace(sensor, noise=sensor.noise / np.sqrt(weight))
    shots = [shots_of(imitation.model, measured(imitation.truth, s, sensor)) for s in several]
    _, names, origin = vector_of(imitation.model, 1)
    own = np.array([len(n) > 1 and n[0] not in imitation.truth.effects and is_gain(n) for n in names])
    found = np.inf
    for share in STARTS[: 1 + 2 * bool(own.any())]:
        found = min(found, _descend(imitation, shots, np.where(own, share * origin, origin)))
        if found < least:
            break
    return found


def _descend(imitation: Imitation, several: Sequence[Shots], start: Array) -> float:
    """The least chi square, price of moving included, that is found from a start."""
    structure, names, origin = vector_of(imitation.model, 1)
    kept = [i for i, n in enumerate(names) if len(n) < 3]
    low, high = np.array([bounds_of(n, names) for n in names]).T

    def at(values: Array) -> tuple[Share, float]:
        share = _total(platform_of(structure, names, values), several)
        moved = (values - origin)[kept]
        return share, share.squares + float(moved @ imitation.prior @ moved)

    values = start
    total, cost = at(values)
    damping = 0.0
    for _ in range(SEPARATION_ROUNDS):
        before = cost
        for _try in range(MAX_SHORTER_STEPS):
            trial = values.copy()
            trial[kept] += total.step(imitation.prior, (values - origin)[kept], damping)
            trial = ordered(names, np.clip(trial, low, high))
            share, new = at(trial)
            if 0.0 < new < cost:
                values, total, cost, damping = trial, share, new, 0.1 * damping
                break
            damping = max(10.0 * damping, 1e-3)
        if before - cost < MIN_ROUND_GAIN * cost:
            break
    return cost if cost > 0.0 else np.inf


def _total(model: Platform, several: Sequence[Shots]) -> Share:
    shares = [share_of(model, s) for s in several]
    total = shares[0]
    for one in shares[1:]:
        total = total + one
    return total


def coarser(sensor: Sensor, highest_hz: float) -> tuple[Sensor, float]:
    """A sensor read at most this often, for a first look, and how many of its samples one stands for."""
    times = max(1, int(sensor.sample_rate_hz / highest_hz))
    return replace(sensor, sample_rate_hz=sensor.sample_rate_hz / times), float(times)
