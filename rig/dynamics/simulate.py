"""From a platform and a torque to the motion: whole sets at once, or one fine step at a time."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from rig import effects
from rig.channels import Channel
from rig.dynamics import integrator
from rig.dynamics.torque import NO_TORQUE, TorqueSignal
from rig.effects._channels import AT_REST, SLOTS
from rig.effects.base import Effect, Place
from rig.platform import Platform
from rig.recording.run import Array

STEP_PHASE_RAD = 0.06  # of the fastest motion in one fine step: 4th order leaves 1e-7 of a frequency
MAX_SUBSTEPS = 64
_NEWTON = 12
_BESIDE_RAD = 1e-6


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


class Readings(Protocol):
    """Whoever knows what the channels of a run read."""

    def table(self, channel: Channel) -> tuple[Array, float]:
        """What acts (see ``Channel``), evenly spaced from the start of the run, and the entries a second."""


def slots(channel: Channel, readings: Readings | None) -> tuple[Array, tuple[float, float, float]]:
    """The table of a channel and the numbers by which a kernel finds it; the table must outlive their use.

    Without ``readings`` the channel stands at its reference.
    """
    table, per_s = readings.table(channel) if readings is not None else (AT_REST, 0.0)
    return table, (float(table.ctypes.data), per_s, float(len(table)))


@lru_cache(maxsize=512)
def _kernels(
    names: tuple[str, ...],
) -> tuple[Any, Any, Any, int, tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Typed kernel lists of a set of effects: loads with frictions, drive, sensor."""
    by_place: dict[Place, list[Effect]] = {place: [] for place in Place}
    for name in names:
        effect = effects.get(name)
        by_place[effect.place].append(effect)
    body = by_place[Place.LOAD] + by_place[Place.FRICTION]
    return (
        integrator.addresses([e.kernel for e in body]),
        integrator.addresses([e.kernel for e in by_place[Place.DRIVE]]),
        integrator.addresses([e.kernel for e in by_place[Place.SENSOR]]),
        len(by_place[Place.LOAD]),
        tuple(e.name for e in body),
        tuple(e.name for e in by_place[Place.DRIVE]),
        tuple(e.name for e in by_place[Place.SENSOR]),
    )


def _offsets(sizes: Sequence[int]) -> Any:
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


@dataclass
class _Filters:
    """A chain of filter kernels with its parameters; states are made when the step is known."""

    kernels: Any
    names: tuple[str, ...]
    values: tuple[tuple[float, ...], ...]

    def arrays(self, step_s: float) -> tuple[Any, Array, Any, Array, Any]:
        sizes = []
        for name, values in zip(self.names, self.values, strict=True):
            count = effects.get(name).filter_states
            sizes.append(count(step_s, values) if count else 0)
        s_at, p_at = _offsets(sizes), _offsets([len(v) for v in self.values])
        p = np.array([x for v in self.values for x in v], dtype=float)
        return self.kernels, np.zeros(int(s_at[-1])), s_at, p, p_at

    def apply(self, x: Array, step_s: float) -> Array:
        if not self.names:
            return x
        kernels, s, s_at, p, p_at = self.arrays(step_s)
        out = np.array(x, dtype=float)
        integrator.run_filter(kernels, out, step_s, s, s_at, p, p_at)
        return out


class Equations:
    """A platform laid out for the compiled integrator."""

    def __init__(self, platform: Platform) -> None:
        kernels, drive, sensor, loads, body, drives, sensors = _kernels(tuple(platform.effects))
        self.jck = np.array([platform.inertia_kg_m2, platform.damping_nm_s_rad, platform.stiffness_nm_rad], dtype=float)
        values = {name: effects.get(name).values(given) for name, given in platform.effects.items()}
        self.kernels, self.loads = kernels, loads
        self.z_at = _offsets([effects.get(name).states for name in body])
        rest = {name: slots(read, None)[1] if (read := effects.get(name).reads) else () for name in body}
        self.p_at = _offsets([3 + len(values[name]) + len(rest[name]) for name in body])
        self.p = np.array([x for name in body for x in (*self.jck, *values[name], *rest[name])], dtype=float)
        self._reading = [(name, int(self.p_at[i + 1]) - SLOTS) for i, name in enumerate(body) if rest[name]]
        self.drive = _Filters(drive, drives, tuple(values[n] for n in drives))
        self.sensor = _Filters(sensor, sensors, tuple(values[n] for n in sensors))
        self._values = values
        self._body = body
        bends = [effects.get(name).kinks for name in body]
        found = [at(values[name]) for name, at in zip(body, bends, strict=True) if at]
        self.kinks = np.unique(np.array([x for each in found for x in each], dtype=float))

    @property
    def states(self) -> int:
        """Number of internal states of all effects on the shaft."""
        return int(self.z_at[-1])

    def rest_states(self, angle_rad: float, rate_rad_s: float) -> Array:
        """Internal states of a platform that has stood at this angle and moves with this rate, shape (states,)."""
        z = np.zeros(self.states)
        if not self.states:
            return z
        for i, name in enumerate(self._body):
            rest = effects.get(name).rest_state
            if rest:
                z[self.z_at[i] : self.z_at[i + 1]] = rest(angle_rad, rate_rad_s)
        return z

    def rest_angle_rad(self) -> float:
        """Where the platform stands without torque, near zero: what its loads pull there, the spring holds.

        Loads with a memory or a clock of their own are taken as they are at the start. Zero where no such place is
        found within a turn.
        """
        if not self.loads or not self.jck[2] > 0.0:
            return 0.0
        at = 0.0
        for _ in range(_NEWTON):
            here, beside = self._pull_nm(at), self._pull_nm(at + _BESIDE_RAD)
            slope = (beside - here) / _BESIDE_RAD
            if not slope > 0.0 or not abs(at) < 2.0 * np.pi:
                return 0.0
            at -= here / slope
        return at if abs(self._pull_nm(at)) <= 1e-9 * self.jck[2] else 0.0

    def _pull_nm(self, angle_rad: float) -> float:
        """Torque by which spring and loads pull a platform back that stands still at an angle."""
        return float(integrator.pull(angle_rad, self.rest_states(0.0, 0.0), self.jck, *self._loads_only()))

    def _loads_only(self) -> tuple[Any, int, Any, Array, Any]:
        return self.kernels, self.loads, self.z_at, self.p, self.p_at

    def scratch(self) -> Array:
        """Room for one step."""
        return np.zeros((9, max(4, self.states)))

    def table(self, motion: Array, z: Array, scratch: Array, steps: int = 0) -> list[int]:
        """Bare addresses for ``integrator.advance`` and its like; the chains of filters follow behind."""
        at = [a.ctypes.data for a in (self.kernels, self.z_at, self.p, self.p_at, self.jck)]
        begin = [motion.ctypes.data, self.states, z.ctypes.data, scratch.ctypes.data, self.loads, len(self.kernels)]
        return [*begin, *at, steps, len(self.kinks), self.kinks.ctypes.data]

    def fastest_rad_s(self) -> float:
        """The fastest motion that a fine step has to follow."""
        j, c, k = self.jck
        j = max(abs(j), 1e-12)  # a set alone may give nonsense; the step must still be a number
        rates = [np.sqrt(abs(k) / j), 0.3 * abs(c) / j]
        for name, values in self._values.items():
            fastest = effects.get(name).fastest_rad_s
            if fastest:
                rates.append(fastest((j, c, k, *values)))
        return float(max(rates))

    def substeps(self, sample_s: float) -> int:
        """Fine steps in one sample period: enough for the fastest motion, at least two."""
        return int(np.clip(np.ceil(sample_s * self.fastest_rad_s() / STEP_PHASE_RAD), 2, MAX_SUBSTEPS))

    def _p(self, readings: Readings | None) -> tuple[Array, list[Array]]:
        """Parameters with the channels of a run, and the tables that must stay as long as they are used."""
        if readings is None or not self._reading:
            return self.p, []
        p, kept = self.p.copy(), []  # runs that share these equations are integrated side by side
        for name, at in self._reading:
            read = effects.get(name).reads
            assert read is not None
            table, p[at : at + SLOTS] = slots(read, readings)
            kept.append(table)
        return p, kept

    def integrate(
        self, torque: Array, step_s: float, start: tuple[float, float], readings: Readings | None = None
    ) -> Array:
        """Angle, rate and acceleration, shape (n + 1, 3), under a shaft torque of shape (n, 3)."""
        p, _kept = self._p(readings)
        state = np.array([start[0], start[1], np.sign(start[1]), 0.0])
        out = np.empty((len(torque) + 1, 3))
        integrator.run_steps(
            state,
            self.rest_states(*start),
            step_s,
            torque,
            self.jck,
            self.kernels,
            self.loads,
            self.z_at,
            p,
            self.p_at,
            self.kinks,
            out,
        )
        return out

    def integrate_shots(
        self, torque: Array, step_s: float, spans: Sequence[tuple[int, int]], starts: Array, offset_s: float = 0.0,
        readings: Readings | None = None,
    ) -> Array:  # fmt: skip
        """As ``integrate``, over spans of fine steps (first, last), each begun from its row of ``starts``.

        Internal states go on from span to span. What lies between spans is zero.
        """
        p, _kept = self._p(readings)
        out = np.zeros((len(torque) + 1, 3))
        if not spans:
            return out
        integrator.run_spans(
            starts, np.array(spans, dtype=np.int64), offset_s, self.rest_states(*starts[0]), step_s, torque,
            self.jck, self.kernels, self.loads, self.z_at, p, self.p_at, self.kinks, out,
        )  # fmt: skip
        return out


@dataclass(frozen=True)
class Motion:
    """What the platform did at the sample instants; ``sensed_rate_rad_s`` is behind the SENSOR effects."""

    angle_rad: Array
    rate_rad_s: Array
    sensed_rate_rad_s: Array


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
        steps = (time_s - time_s[0]) / self.step_s
        nearest = np.rint(steps).astype(np.int64)
        self._index = nearest if np.max(np.abs(steps - nearest)) < 1e-4 else None
        self.n = int(np.ceil(steps[-1] - 1e-4))
        torque = torque or NO_TORQUE
        self._held = torque.hold == "zero_order"
        self._plain: Array | None = None
        self._finer: Array | None
        self._lead = 2 * int(lead_s / self.step_s)
        self._torque, self._factor, self._finer = torque, 1.0, None
        self._half = self._torque_every(0.5 * self.step_s)

    def scaled(self, factor: float) -> Grid:
        """The same grid with its torque multiplied: reading a smooth torque off its samples costs more than that."""
        other = copy(self)
        other._half, other._plain, other._factor = factor * self._half, None, factor * self._factor
        other._finer = None
        return other

    def _torque_every(self, step_s: float) -> Array:
        """The torque asked of the drive, from the lead to the last instant."""
        lead_s = 0.5 * self.step_s * self._lead
        count = round((self.n * self.step_s + lead_s) / step_s) + 1
        return self._torque.on_half_steps(float(self.time_s[0]) - lead_s, step_s, count)

    def shaft_torque(self, equations: Equations) -> Array:
        """Torque behind the drive effects at start, middle and end of each fine step, shape (n, 3)."""
        if not equations.drive.names and self._plain is not None:
            return self._plain
        if not self._held and any(effects.get(name).bends_torque for name in equations.drive.names):
            return self._bent(equations)
        steps = self._by_step(equations.drive.apply(self._half, 0.5 * self.step_s)[self._lead :])
        if not equations.drive.names:
            self._plain = steps
        return steps

    def _bent(self, equations: Equations) -> Array:
        """Torque with corners inside of steps: the quadratics that push, twist and bend each step as it does."""
        parts = _PARTS
        if self._finer is None:
            self._finer = self._factor * self._torque_every(self.step_s / parts)
        torque = equations.drive.apply(self._finer, self.step_s / parts)[self._lead // 2 * parts :]
        weights, values = _PROJECTION, np.empty((self.n, parts + 1))
        values[:, :parts] = torque[: self.n * parts].reshape(self.n, parts)
        values[:, parts] = torque[parts : self.n * parts + 1 : parts]
        return np.ascontiguousarray(values @ weights)

    def _by_step(self, half: Array) -> Array:
        if self._held:
            mean = 0.5 * (half[0:-1:2] + half[1::2])
            return np.ascontiguousarray(np.stack([mean, mean, mean], axis=1))
        return np.ascontiguousarray(np.stack([half[0:-1:2], half[1::2], half[2::2]], axis=1))

    def sample(self, fine: Array, slope: Array) -> Array:
        """Values at the sample instants from values (and slopes) on the fine grid, shape (n,)."""
        if self._index is not None:
            return fine[self._index]
        t = self.step_s * np.arange(self.n + 1)
        return np.asarray(CubicHermiteSpline(t, fine, slope)(self.time_s - self.time_s[0]), dtype=float)

    def simulate(self, equations: Equations, start: tuple[float, float]) -> Motion:
        """Motion at the sample instants from ``start`` (angle_rad, rate_rad_s) at the first one."""
        fine = equations.integrate(self.shaft_torque(equations), self.step_s, start)
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

    Raises
    ------
    KeyError
        For an effect or parameter that does not exist.
    """
    equations = Equations(platform)
    if substeps is None:
        substeps = equations.substeps(float(np.median(np.diff(time_s))))
    return Grid(time_s, torque, substeps).simulate(equations, start)


class Stepper:
    """The same equations, one fine step at a time: for a rig that is played tick by tick."""

    def __init__(self, platform: Platform, step_s: float) -> None:
        self.equations = Equations(platform)
        self.step_s = step_s
        self.substeps = self.equations.substeps(step_s) if self.equations.fastest_rad_s() > 0 else 1
        self.reset()

    def reset(self, angle_rad: float = 0.0, rate_rad_s: float = 0.0) -> None:
        """Put the platform at an angle and a rate, all memory of the past forgotten, time zero."""
        e = self.equations
        fine_s = self.step_s / self.substeps
        motion = np.array([angle_rad, rate_rad_s, np.sign(rate_rad_s), 0.0])
        z = e.rest_states(angle_rad, rate_rad_s)
        scratch = e.scratch()
        drive, sensor = e.drive.arrays(fine_s), e.sensor.arrays(fine_s)
        self._kept = (motion, z, scratch, drive, sensor)  # the table below holds bare addresses of these
        table = e.table(motion, z, scratch, self.substeps)
        for chain in (drive, sensor):
            table += [len(chain[0]), *(a.ctypes.data for a in chain)]
        self._table = np.array(table, dtype=np.int64)
        self._values = np.array([fine_s, 0.0, 0.0, angle_rad, rate_rad_s, rate_rad_s, 0.0])

    def advance(self, torque_start_nm: float, torque_end_nm: float) -> tuple[float, float, float, float]:
        """One step under a torque that runs linearly between two values (equal: held).

        Returns
        -------
        angle_rad, rate_rad_s, sensed_rate_rad_s, shaft_torque_nm
            At the end of the step.
        """
        self._values[1], self._values[2] = torque_start_nm, torque_end_nm
        integrator.advance(self._table, self._values)
        _, _, _, angle, rate, sensed, shaft = self._values.tolist()
        return angle, rate, sensed, shaft
