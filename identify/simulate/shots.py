"""A run as the simulator sees it: cut into shots, each with a start state of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from identify.model.parameters import Name, equations_of
from identify.model.structure import Structure
from identify.signals.trace import LEAD_S, UPSAMPLING, Trace, drop_samples_at_seam
from rig.dynamics import Equations, Grid
from rig.dynamics.low_pass import low_pass_kernel, mean_rate, smoothed
from rig.recording.run import Array

LATEST_FIRST_STRETCH_S = 0.02  # a first stretch that begins by then is simulated from the beginning of the run
MAX_RATE_SHARE_AT_REST = 5e-3  # of the run's highest rate: below it, a gyro's bias included, a run begins at rest
SENSOR_LEAD_S = 0.02  # longer than a gyro's filter remembers
RUNAWAY = np.errstate(over="ignore", invalid="ignore", divide="ignore")  # a simulation may; its error is then infinite


@dataclass
class Shots:
    """One run as the simulator sees it: its fine grid, its shots and their start states."""

    trace: Trace
    grid: Grid
    first: Any  # sample number at which each shot begins, (s,)
    starts: Array  # angle and rate there, (s, 2)
    bias: float = 0.0
    weight: Any = field(default=None)  # (n,) boolean: samples that count
    rests: bool = False  # the first shot begins at rest, for certain: its start state is not fitted
    reads: int = 1  # how often in a fine step a sensor's filter is fed, where the motion is predicted sample by sample

    @property
    def number(self) -> int:
        """Which run of the recording it is."""
        return self.trace.number

    @property
    def added(self) -> float:
        """Known inertia mounted for this run."""
        return self.trace.run.added_inertia_kg_m2

    @cached_property
    def since_s(self) -> Array:
        """Time over which the angle at the start of each shot was integrated, bias and all, (s,)."""
        since = np.asarray(self.trace.offset_s + self.trace.step_s * self.first)
        return since if self.trace.drift_rad is None else np.zeros_like(since)

    @cached_property
    def in_motion(self) -> tuple[bool, ...]:
        """Whether each shot begins in motion: nobody knows what moves inside the platform there, (s,)."""
        from_rest = self.trace.offset_s <= SENSOR_LEAD_S and begins_at_rest(self.trace)
        return tuple(not (from_rest and k * self.trace.step_s <= LATEST_FIRST_STRETCH_S) for k in self.first.tolist())

    @cached_property
    def active(self) -> Any:
        """Which shots hold samples that count; the others are not simulated."""
        return np.array([bool(np.any(self.weight[a:b])) for a, b in self.edges])

    @cached_property
    def counts(self) -> Array:
        """Samples that count in each shot, (shots,)."""
        return np.array([float(np.sum(self.weight[a:b])) for a, b in self.edges])

    @cached_property
    def edges(self) -> list[tuple[int, int]]:
        """First sample and one past the last of each shot."""
        ends = [*self.first[1:].tolist(), len(self.trace.measured)]
        return list(zip(self.first.tolist(), ends, strict=True))


def make_shots(
    trace: Trace, substeps: int, length: int | None, use: Any = None, equations: Equations | None = None,
    rests: bool = False,
) -> Shots:  # fmt: skip
    """Cut a run into shots of ``length`` samples (None: one), started from the smoothed measurement.

    What has a memory begins at rest, and that is where the run begins: with such ``equations`` the first shot does too,
    and with ``rests`` whatever they are.
    """
    n = len(trace.measured)
    time = trace.start_s + trace.step_s * np.arange(n)
    begins = [0]  # every usable stretch begins anew: what happened in between is not to be predicted
    soon = rests or (equations is not None and _begins_with_the_run(equations, trace))
    for a, b in trace.stretches:
        if soon and a * trace.step_s <= LATEST_FIRST_STRETCH_S:
            a = 0  # noqa: PLW2901
        inside = np.arange(a, b + 1, length) if length else np.array([a])
        if length and len(inside) > 1 and b + 1 - inside[-1] < length // 2:
            inside = inside[:-1]
        begins += inside.tolist()
    first = np.unique(np.array(begins))
    angle, rate, _, _, _ = trace.fine
    ratio = (len(angle) - 1) // (n - 1)
    starts = np.stack([angle[first * ratio], rate[first * ratio]], axis=1)
    weight = trace.keep.copy() if use is None else trace.keep & use
    for seam in (*first.tolist(), n):
        drop_samples_at_seam(trace, seam, weight)
    rests = rests and bool(first[0] == 0 and np.any(weight[: [*first[1:], n][0]]))
    if rests:
        starts[0] = 0.0
    grid = Grid(time, trace.torque, substeps, min(LEAD_S, trace.offset_s))
    return Shots(trace, grid, first, starts, 0.0, weight, rests)


def _begins_with_the_run(equations: Equations, trace: Trace) -> bool:
    """Whether the start state belongs to the first sample of a run, though the first ones that count come later.

    It takes up what a torque from before the run did, as a start at the first sample that counts would. Under dry
    friction only a run that begins at rest does so, and only for a sensor's memory: it is stuck there, and all that
    the start state can tell is the angle.
    """
    if equations.sticks:
        return bool(equations.sensor.names) and begins_at_rest(trace)
    return bool(equations.states or equations.sensor.names)


def begins_at_rest(trace: Trace) -> bool:
    """Whether the first sample shows no motion beyond the noise and a gyro's bias."""
    rate = trace.measured if trace.channel == "rate" else trace.fine[1][::UPSAMPLING]  # smoothing looks ahead
    return bool(abs(rate[0]) < max(MAX_RATE_SHARE_AT_REST * float(np.max(np.abs(rate))), 5.0 * trace.noise))


def may_rest(trace: Trace, equations: Equations) -> bool:
    """Whether a run may be held to begin at rest, where the model stands without torque.

    A gyro's angle begins at zero wherever that is; an encoder's zero and a platform held by friction are anywhere.
    """
    return trace.biased and not equations.sticks and begins_at_rest(trace)


def from_rest(shots: Shots, equations: Equations) -> Shots:
    """The same shots with their angles counted from where the model stands without torque.

    A gyro's angle begins at zero wherever the platform rests; a load that pulls there (gravity, a magnet, a constant
    torque) would otherwise set it in motion, and the fit off for good.
    """
    if shots.trace.biased:
        shots.starts = shots.starts + np.array([equations.rest_angle_rad(), 0.0])
    return shots


def predict(shots: Shots, equations: Equations, starts: Array, bias: float, push: Array | None = None) -> Array:
    """The measured channel as the model gives it, shape (n,); ``push`` is a further resisting torque (see motion)."""
    moving = motion(shots, equations, starts, push)
    return read_off(shots, equations, moving.fine, moving.first, bias)


def read_off(shots: Shots, equations: Equations, fine: Array, first: int, bias: float) -> Array:
    """The measured channel of a motion, (m, 2) or (m, 3), that is simulated from one instant on, shape (n,)."""
    grid = shots.grid
    ratio = round(shots.trace.step_s / grid.step_s)
    n = len(shots.trace.measured)
    if shots.trace.channel == "angle":
        return np.asarray(fine[: n * ratio : ratio, 0])
    turned, step_s = fine[:, 1], grid.step_s
    low_pass = shots.trace.low_pass
    if low_pass is not None:
        turned = mean_rate(fine[:, 0], turned, step_s)
    if equations.sensor.names:
        turned = _sensed(equations, turned, first, step_s)
    if low_pass is not None:
        turned = smoothed(turned, low_pass_kernel(*low_pass, step_s, 2.0 * step_s))
    return np.asarray(turned[: n * ratio : ratio] + bias)


class Moving(NamedTuple):
    """A simulated run: angle, rate and acceleration at every fine instant, (m, 3), and what they came from."""

    fine: Array
    torque: Array  # (m - 1, 3)
    spans: list[tuple[int, int]]  # of fine steps that are simulated
    starts: Array

    @property
    def first(self) -> int:
        """The first instant that is simulated."""
        return self.spans[0][0] if self.spans else 0


def motion(shots: Shots, equations: Equations, starts: Array, push: Array | None = None) -> Moving:
    """A run simulated from its start states.

    ``push``, (m - 1, 3), is a torque at start, middle and end of each fine step that resists besides.
    """
    grid = shots.grid
    torque = grid.shaft_torque(equations)
    if push is not None:
        torque = torque - push
    ratio = round(shots.trace.step_s / grid.step_s)
    n = len(shots.trace.measured)
    on = shots.active
    remembers = equations.states or equations.sensor.names
    if remembers and len(on) > 1 and not on[0] and shots.first[1] * shots.trace.step_s <= LATEST_FIRST_STRETCH_S:
        on = np.concatenate([[True], on[1:]])  # what remembers begins where the run does, not where samples count
    active = [(a * ratio, min(b, n - 1) * ratio) for (a, b), used in zip(shots.edges, on, strict=True) if used]
    fine = equations.integrate_shots(torque, grid.step_s, active, starts[on], shots.trace.since_start_s, shots.trace)
    return Moving(fine, torque, active, starts[on])


def _sensed(equations: Equations, rate: Array, first: int, step_s: float) -> Array:
    """The rate behind the sensor's filters, which have seen the motion before it is simulated: straight backwards."""
    lead = round(SENSOR_LEAD_S / step_s)
    slope = rate[first + 1] - rate[first] if first + 1 < len(rate) else 0.0
    before = rate[first] + slope * np.arange(-lead, 0)
    sensed = equations.sensor.apply(np.concatenate([before, rate[first:]]), step_s)
    return np.concatenate([rate[:first], sensed[lead:]])


@RUNAWAY
def losses_of(shots: Shots, residual: Array) -> Array:
    """Sum of squares of every shot over the samples that count, (shots,); infinite where it ran away."""
    squares = np.where(shots.weight, residual**2, 0.0)
    sums = np.array([float(np.sum(squares[a:b])) for a, b in shots.edges])
    return np.where(np.isfinite(sums), sums, np.inf)


def residual_at(shots: Shots, structure: Structure, names: Sequence[Name], x: Array) -> tuple[Array, Array]:
    """Measured minus simulated at a parameter vector, (n,), and its sum of squares in every shot, (shots,)."""
    residual = shots.trace.measured - predict(
        shots, equations_of(structure, names, x, shots.number, shots.added), shots.starts, shots.bias
    )
    return residual, losses_of(shots, residual)


def moved(shots: Shots, by: tuple[Array, float]) -> Shots:
    """The same shots with other start states and bias."""
    return replace(shots, starts=shots.starts + by[0], bias=shots.bias + by[1])


def with_bias(s: Shots, bias: float) -> Shots:
    """The same shots with another bias.

    Start angles were integrated from the rate since the run began, and the bias with it: a stretch cut out of the
    middle of a run begins as far off as its bias has carried the angle by then.
    """
    starts = s.starts.copy()
    starts[:, 0] -= (bias - s.bias) * s.since_s
    return replace(s, starts=starts, bias=bias)
