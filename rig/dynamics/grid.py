"""A run on a fine time grid: the torque that reaches the shaft in every step, and the motion under it."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from rig import effects
from rig.arrays import Array
from rig.dynamics.equations import Equations
from rig.dynamics.low_pass import low_pass_kernel, smoothed
from rig.dynamics.torque import NO_TORQUE, TorqueSignal
from rig.platform import Platform


def _projection(parts: int) -> Array:
    """From values at the ends of equal parts of a step to its start, middle and end, shape (parts + 1, 3).

    They stand for the quadratic with the same mean, first and second moment as the straight lines between the values.
    """
    x = np.linspace(-0.5, 0.5, parts + 1)
    out = np.zeros((parts + 1, 3))
    nodes, share = np.polynomial.legendre.leggauss(3)
    for k in range(parts):
        for node, weight in zip(0.5 * (nodes + 1.0), 0.5 * share / parts, strict=True):
            u = x[k] + node / parts
            moments = np.array([1.0, 12.0 * u, 180.0 * (u * u - 1.0 / 12.0)])
            a, b, c = weight * moments
            at = np.array([a - 0.5 * b + c / 6.0, a - c / 12.0, a + 0.5 * b + c / 6.0])
            out[k] += (1.0 - node) * at
            out[k + 1] += node * at
    return out


_PARTS = 8  # of a step, where the torque has corners
_PROJECTION = _projection(_PARTS)
FINE_SUBSTEPS = 16  # of a sample period: with so many, a corner needs no parts of a step


MAX_TORQUES_KEPT = 3  # torques behind the drive: of all parameters only the drive's own change it
QUARTERS = 4  # of a step, over each of which the mean of a held torque is known


def _line_through_quarters() -> Array:
    """From the means over the quarters of a step to start, middle and end of a straight line, shape (4, 3).

    The line pushes as much as the quarters do, and as early or late: a held torque that changes within a step and
    enters as the mean of the step alone acts like one that was smoothed, which lowers a ring of 29 Hz by 1e-4 and every
    parameter with it. The slope is that of a steady rise, of which the quarters show 15/16.
    """
    middles = (np.arange(QUARTERS) + 0.5) / QUARTERS - 0.5
    mean, slope = np.full(QUARTERS, 1.0 / QUARTERS), middles / np.sum(middles**2)
    return np.stack([mean - 0.5 * slope, mean, mean + 0.5 * slope], axis=1)


_OF_QUARTERS = _line_through_quarters()


@dataclass(frozen=True)
class Motion:
    """What the platform did at the sample instants; ``sensed_rate_rad_s`` is behind the SENSOR effects."""

    angle_rad: Array
    rate_rad_s: Array
    sensed_rate_rad_s: Array


class Smoothing(NamedTuple):
    """What a gyro's own low-pass adds to the torque, and by that to the motion of a linear platform.

    Attributes
    ----------
    torque_nm
        At start, middle and end of each fine step, (n, 3). On a linear platform this torque alone moves the rate as the
        filter changes it.
    begins
        What it has added by the start of each fine step to the integrals of the torque, the second in N m s^2 and the
        first in N m s, (n + 1, 2): times inertia, angle and rate by which a platform is beside itself there.
    """

    torque_nm: Array
    begins: Array


def _kept(store: dict[Any, Any], key: Any, found: Any) -> Any:
    while len(store) >= MAX_TORQUES_KEPT:  # simulations in other threads may be doing the same
        store.pop(next(iter(store), None), None)
    store[key] = found
    return found


class Grid:
    """The fine time grid of one run, with its torque: made once, simulated many times.

    Parameters
    ----------
    time_s
        Shape (n,), strictly increasing; may be jittered or have gaps.
    torque
        The torque asked of the drive, or None for free motion.
    substeps
        Fine steps per (median) sample period.
    lead_s
        How far before the first sample the torque is known: a drive with memory has seen it.
    """

    def __init__(self, time_s: Array, torque: TorqueSignal | None, substeps: int, lead_s: float = 0.0) -> None:
        spacing = np.diff(time_s)
        sample_s = float(np.median(spacing))
        self.time_s = time_s
        self.step_s = sample_s / substeps
        self._fine = substeps >= FINE_SUBSTEPS
        steps = (time_s - time_s[0]) / self.step_s
        nearest = np.rint(steps).astype(np.int64)
        self._index = nearest if np.max(np.abs(steps - nearest)) < 1e-4 else None
        self.n = int(np.ceil(steps[-1] - 1e-4))
        torque = torque or NO_TORQUE
        self._held = torque.hold == "zero_order"
        self._shaft: dict[Any, Array] = {}
        self._smoothing: dict[Any, Smoothing] = {}
        self._finer: Array | None
        self._lead = max(0, int(lead_s / self.step_s))  # jittered stamps may begin a little before the beat
        self._torque, self._factor, self._finer = torque, 1.0, None
        self._pieces = QUARTERS if self._held else 2
        self._given = self._torque_every(self.step_s / self._pieces)

    def scaled(self, factor: float) -> Grid:
        """The same grid with its torque multiplied: reading a smooth torque off its samples costs more than that."""
        other = copy(self)
        other._given, other._shaft, other._factor = factor * self._given, {}, factor * self._factor
        other._smoothing = {}
        other._finer = None
        return other

    def _torque_every(self, step_s: float) -> Array:
        """The torque asked of the drive, from the lead to the last instant."""
        lead_s = self.step_s * self._lead
        count = round((self.n * self.step_s + lead_s) / step_s) + 1
        return self._torque.on_half_steps(float(self.time_s[0]) - lead_s, step_s, count)

    def shaft_torque(self, equations: Equations) -> Array:
        """Torque behind the drive effects at start, middle and end of each fine step, shape (n, 3)."""
        drive = equations.drive
        key = (drive.names, drive.values)
        found = self._shaft.get(key)
        if found is None:
            found = _kept(self._shaft, key, self._behind(equations))
        return found

    def smoothing(self, equations: Equations, low_pass: tuple[float, float]) -> Smoothing:
        """What a gyro's low-pass (corner in Hz, delay in s) does to that torque."""
        drive, part_s = equations.drive, self.step_s / self._pieces
        key = (drive.names, drive.values, low_pass)
        found = self._smoothing.get(key)
        if found is None:
            ahead = int(np.ceil(low_pass[1] / self.step_s)) + 1  # steps by which the filter sees a torque coming
            given = drive.apply(self._given, part_s)[max(0, self._lead - ahead) * self._pieces :]
            missing = max(0, ahead - self._lead) * self._pieces
            if missing:
                first_s = float(self.time_s[0]) - ahead * self.step_s
                before = self._factor * self._torque.on_half_steps(first_s, part_s, missing)
                given = np.concatenate([drive.apply(before, part_s), given])
            kernel = low_pass_kernel(*low_pass, part_s)
            skipped = ahead * self._pieces

            def added(values: Array) -> Array:
                return np.asarray((smoothed(values, kernel) - values)[skipped:])

            impulse = part_s * np.concatenate([[0.0], np.cumsum(given)])
            twist = part_s * np.concatenate([[0.0], np.cumsum(0.5 * (impulse[1:] + impulse[:-1]))])
            begins = np.stack([added(twist), added(impulse)], axis=1)[:: self._pieces]
            found = _kept(self._smoothing, key, Smoothing(self._by_step(added(given)), np.ascontiguousarray(begins)))
        return found

    def _behind(self, equations: Equations) -> Array:
        if not self._held and not self._fine and any(effects.get(name).bends_torque for name in equations.drive.names):
            return self._bent(equations)
        given = equations.drive.apply(self._given, self.step_s / self._pieces)
        return self._by_step(given[self._lead * self._pieces :])

    def _bent(self, equations: Equations) -> Array:
        """Torque with corners inside of steps: the quadratics that push, twist and bend each step as it does."""
        parts = _PARTS
        if self._finer is None:
            self._finer = self._factor * self._torque_every(self.step_s / parts)
        torque = equations.drive.apply(self._finer, self.step_s / parts)[self._lead * parts :]
        weights, values = _PROJECTION, np.empty((self.n, parts + 1))
        values[:, :parts] = torque[: self.n * parts].reshape(self.n, parts)
        values[:, parts] = torque[parts : self.n * parts + 1 : parts]
        return np.ascontiguousarray(values @ weights)

    def _by_step(self, given: Array) -> Array:
        if self._held:
            return np.ascontiguousarray(given[: self.n * QUARTERS].reshape(self.n, QUARTERS) @ _OF_QUARTERS)
        return np.ascontiguousarray(np.stack([given[0:-1:2], given[1::2], given[2::2]], axis=1))

    def sample(self, fine: Array, slope: Array) -> Array:
        """Values at the sample instants from values (and slopes) on the fine grid, shape (n,)."""
        if self._index is not None:
            return fine[self._index]
        t = self.step_s * np.arange(self.n + 1)
        return np.asarray(CubicHermiteSpline(t, fine, slope)(self.time_s - self.time_s[0]), dtype=float)

    def simulate(self, equations: Equations, start: tuple[float, float], states: Array | None = None) -> Motion:
        """Motion at the sample instants from ``start`` (angle_rad, rate_rad_s) at the first one.

        ``states`` as in ``Equations.integrate``.
        """
        fine = equations.integrate(self.shaft_torque(equations), self.step_s, start, states=states)
        angle, rate, acceleration = fine[:, 0], fine[:, 1], fine[:, 2]
        sampled = self.sample(rate, acceleration)
        sensed = sampled
        if equations.sensor.names:
            late = equations.sensor.apply(rate, self.step_s)
            sensed = self.sample(late, np.gradient(late, self.step_s))
        return Motion(self.sample(angle, rate), sampled, sensed)


def simulate(
    platform: Platform,
    time_s: Array,
    torque: TorqueSignal | None,
    start: tuple[float, float] = (0.0, 0.0),
    substeps: int | None = None,
    states: Array | None = None,
) -> Motion:
    """Motion of a platform over a whole set.

    Parameters
    ----------
    time_s
        Shape (n,): the instants wanted.
    torque
        Torque on the same clock, or None for free motion.
    start
        Angle in rad and rate in rad/s at ``time_s[0]``.
    substeps
        Fine steps a sample; chosen from the platform's fastest motion when left out.
    states
        Internal states at ``time_s[0]``, of a platform at rest where None; they are left as at the end.

    Raises
    ------
    KeyError
        For an effect or parameter that does not exist.
    """
    equations = Equations(platform)
    if substeps is None:
        substeps = equations.substeps(float(np.median(np.diff(time_s))))
    return Grid(time_s, torque, substeps).simulate(equations, start, states)
