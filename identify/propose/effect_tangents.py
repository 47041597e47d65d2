"""What a little of a candidate adds to the simulated channel of every run, along the model's own motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.estimate.output_error import Estimate
from identify.model.effect_torque import torque_along
from identify.model.parameters import Name, platform_of
from identify.simulate.linearisation import Neighbourhood
from identify.simulate.shots import Shots, motion, predict
from rig.dynamics import Equations, Grid
from rig.dynamics.equations import MAX_SUBSTEPS
from rig.effects.base import Effect, Place, Scale
from rig.platform import Platform
from rig.recording.run import Array

LITTLE = 1e-4  # of the torque: more of a candidate would shift the ring beyond where sensitivities hold
PHASE_RAD = 0.2  # of a candidate's own fastest motion in one of its steps

Push = tuple[dict[Name, float], bool]  # parameter values of a little of a candidate, and whether it may turn its sign


@dataclass
class Around:
    """One run around the model: projector, projected sensitivities and residual, and its motion once asked for."""

    shots: Shots
    base: Array
    basis: Array
    columns: Array
    residual: Array
    near: Neighbourhood | None
    along: tuple[Array, Array, Array, Array] | None = None

    def project(self, values: Array) -> Array:
        """What start states and bias cannot follow of one value a sample, of those that count."""
        used = values[self.shots.weight]
        return np.asarray(used - self.basis @ (self.basis.T @ used))


class Directions:
    """Candidates in small amounts around one model.

    Parameters
    ----------
    estimate
        The model, fitted over whole runs.
    runs
        Its runs, or parts of them.
    scale
        How large the motion is.
    """

    def __init__(self, estimate: Estimate, runs: Sequence[Around], scale: Scale) -> None:
        self.estimate, self.runs, self.scale = estimate, runs, scale
        self.largest_first = sorted(runs, key=lambda r: -float(np.std(r.base)))
        self._finer_ones: dict[tuple[int, int], tuple[Shots, Array]] = {}

    def pushes(self, effect: Effect, shape: tuple[float, ...]) -> list[Push]:
        """A little of the candidate, once for every gain: parameter values, and whether they may turn their sign."""
        shapes = iter(shape)
        held: dict[Name, float] = {(effect.name, p.name): next(shapes) for p in effect.parameters if not p.linear}
        gains = [(i, p) for i, p in enumerate(effect.parameters) if p.linear]
        if not gains:
            return [(held, False)]
        larger = dict(effect.ordered)
        out = []
        for i, p in gains:
            unit = self._unit(effect, shape, i)
            if unit == 0.0:
                continue
            little = LITTLE * self.scale.torque_nm / unit
            rest: dict[Name, float] = {(effect.name, q.name): 0.0 for _, q in gains}
            for run in self.runs if p.per_run else self.runs[:1]:
                number = run.shots.number
                push = dict(rest)
                push[(effect.name, p.name)] = little
                if p.name in larger:
                    push[(effect.name, larger[p.name])] = little
                named = {(*k, str(number)) if p.per_run and k in rest else k: v for k, v in {**held, **push}.items()}
                out.append((named, p.low < 0.0))
        return out

    def _unit(self, effect: Effect, shape: tuple[float, ...], gain: int) -> float:
        """Root mean square torque of a gain of one along the measured motion of the run that moves most."""
        if effect.place in (Place.DRIVE, Place.SENSOR):
            return 1.0
        for run in self.largest_first:
            pieces = run.shots.trace.effect_pieces(effect, shape, gain)
            if pieces is not None:
                return float(np.sqrt(np.mean(pieces[:, 0] ** 2)))
        return 0.0

    def of(self, effect: Effect, push: Push) -> list[Array] | None:
        """What the push adds to the simulated channel of every run, projected."""
        out: list[Array] = []
        for run in self.runs:
            mine = [n for n in push[0] if len(n) < 3 or int(n[2]) == run.shots.number]
            if not any(push[0][n] for n in mine if len(n) == 3) and any(len(n) == 3 for n in push[0]):
                out.append(np.zeros(len(run.residual)))
                continue
            held = {n[1]: push[0][n] for n in mine}
            e = self.estimate
            bare = platform_of(e.structure, e.names, e.values, run.shots.number, run.shots.added)
            platform = replace(bare, effects={**bare.effects, effect.name: held})
            if effect.place is Place.LOAD and not effect.reads:
                moved = self._pushed(run, Equations(bare), effect, held)
            else:
                equations = Equations(platform)
                shots, base = self._finer(run, bare, equations)
                moved = predict(shots, equations, shots.starts, shots.bias) - base
            if not np.all(np.isfinite(moved[run.shots.weight])):
                return None
            out.append(run.project(moved))
        return out

    def _pushed(self, run: Around, bare: Equations, effect: Effect, held: Mapping[str, float]) -> Array:
        """What the torque that a little of a candidate makes along the model's own motion adds to the channel.

        To first order that is the candidate, however fast its own states are.
        """
        values = effect.values(held)
        s = run.shots
        if run.along is None:
            run.along = run.near.half if run.near else _half_steps(s, bare)
        angle, rate, time, torque = run.along
        step = 0.5 * s.grid.step_s
        substeps = 1
        if effect.states and effect.fastest_rad_s:
            substeps = int(np.clip(np.ceil(step * effect.fastest_rad_s((*bare.jck, *values)) / PHASE_RAD), 1, 16))
        z = np.array(effect.rest_state(angle[0], rate[0]) if effect.rest_state else [0.0] * effect.states, dtype=float)
        p = np.array([*bare.jck, *values])
        out = np.empty_like(angle)
        torque_along(effect.kernel.address, angle, rate, time, torque, step, z.copy(), substeps, p, False, 1.0, out)
        if s.trace.biased:  # a pull at rest shifts the place that angles are counted from (see from_rest): no push
            still, rest = np.full(3, bare.rest_angle_rad()), np.zeros(3)
            torque_along(effect.kernel.address, still, 0 * still, 0 * still, 0 * still, step, z, 1, p, False, 1.0, rest)
            out -= rest[0]
        push = np.stack([out[:-1:2], out[1::2], out[2::2]], axis=1)
        return run.near.resisted(push) if run.near else predict(s, bare, s.starts, s.bias, push) - run.base

    def _finer(self, run: Around, bare: Platform, equations: Equations) -> tuple[Shots, Array]:
        """The same shots on a grid that a fast candidate needs, and the model's own motion there."""
        trace = run.shots.trace
        here = round(trace.step_s / run.shots.grid.step_s)
        needed = int(np.clip(equations.substeps(trace.step_s) // 2, 2, MAX_SUBSTEPS))
        if needed <= here:
            return run.shots, run.base
        needed = min(MAX_SUBSTEPS, 2 ** int(np.ceil(np.log2(needed))))
        key = (run.shots.number, needed)
        if key not in self._finer_ones:
            time = trace.start_s + trace.step_s * np.arange(len(trace.measured))
            shots = replace(run.shots, grid=Grid(time, trace.torque, needed, 0.0))
            self._finer_ones[key] = shots, predict(shots, Equations(bare), shots.starts, shots.bias)
        return self._finer_ones[key]


def _half_steps(s: Shots, equations: Equations) -> tuple[Array, Array, Array, Array]:
    """Angle, rate, time and torque of the model at start, middle and end of its fine steps, (2 m - 1,) each."""
    moving = motion(s, equations, s.starts)
    fine, first, steps, h = moving.fine[:, :2], moving.first, moving.torque, s.grid.step_s
    out = np.empty((2 * len(fine) - 1, 2))
    out[::2] = fine
    slope = np.stack([fine[:, 1], np.gradient(fine[:, 1], h)], axis=1)
    out[1::2] = 0.5 * (fine[1:] + fine[:-1]) + h / 8.0 * (slope[:-1] - slope[1:])
    out[: 2 * first] = fine[first]  # at rest where nothing was simulated
    out[: 2 * first, 1] = 0.0
    torque = np.empty(len(out))
    torque[::2], torque[1::2] = np.append(steps[:, 0], steps[-1, 2]), steps[:, 1]
    return out[:, 0].copy(), out[:, 1].copy(), s.trace.offset_s + 0.5 * h * np.arange(len(out)), torque
