"""A platform laid out for the compiled integrator: whole runs, and shots within them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from rig import effects
from rig.arrays import Array
from rig.channels import Channel
from rig.dynamics import integrator
from rig.dynamics.filters import run_filter
from rig.dynamics.native import addresses
from rig.effects._channels import AT_REST, SLOTS
from rig.effects.base import Effect, Place
from rig.platform import Platform

STEP_PHASE_RAD = 0.06  # of the fastest motion in one fine step: 4th order leaves 1e-7 of a frequency
MAX_SUBSTEPS = 64
_NEWTON = 12
_BESIDE_RAD = 1e-6


class Readings(Protocol):
    """Whoever knows what the channels of a run read."""

    def table(self, channel: Channel) -> tuple[Array, float, float]:
        """What acts (see ``Channel``), evenly spaced, the entries a second, and when in the run the first is, s."""


def slots(channel: Channel, readings: Readings | None) -> tuple[Array, tuple[float, float, float, float]]:
    """The table of a channel and the numbers by which a kernel finds it; the table must outlive their use.

    Without ``readings`` the channel stands at its reference.
    """
    table, per_s, begin_s = readings.table(channel) if readings is not None else (AT_REST, 0.0, 0.0)
    return table, (float(table.ctypes.data), per_s, float(len(table)), begin_s)


@lru_cache(maxsize=512)
def _kernels(
    names: tuple[str, ...],
) -> tuple[Any, Any, Any, int, tuple[str, ...], tuple[str, ...], tuple[str, ...], bool]:
    """Typed kernel lists of a set of effects: loads with frictions, drive, sensor; whether the first are all steady."""
    by_place: dict[Place, list[Effect]] = {place: [] for place in Place}
    for name in names:
        effect = effects.get(name)
        by_place[effect.place].append(effect)
    body = by_place[Place.LOAD] + by_place[Place.FRICTION]
    return (
        addresses([e.kernel for e in body]),
        addresses([e.kernel for e in by_place[Place.DRIVE]]),
        addresses([e.kernel for e in by_place[Place.SENSOR]]),
        len(by_place[Place.LOAD]),
        tuple(e.name for e in body),
        tuple(e.name for e in by_place[Place.DRIVE]),
        tuple(e.name for e in by_place[Place.SENSOR]),
        all(e.is_steady for e in body),
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
        run_filter(kernels, out, step_s, s, s_at, p, p_at)
        return out


class Equations:
    """A platform laid out for the compiled integrator."""

    def __init__(self, platform: Platform) -> None:
        kernels, drive, sensor, loads, body, drives, sensors, self.steady = _kernels(tuple(platform.effects))
        self.jck = np.array([platform.inertia_kg_m2, platform.damping_nm_s_rad, platform.stiffness_nm_rad], dtype=float)
        values = {name: effects.get(name).values(given) for name, given in platform.effects.items()}
        self.kernels, self.loads = kernels, loads
        self.z_at = _offsets([effects.get(name).states for name in body])
        rest = {name: slots(read, None)[1] if (read := effects.get(name).reads) else () for name in body}
        self.p_at = _offsets([3 + len(values[name]) + len(rest[name]) for name in body])
        own = [x for name in body for x in (*self.jck, *values[name], *rest[name])]
        ways = [self._way_rad(name, values[name]) for name in body for _ in range(effects.get(name).states)]
        self.p = np.array([*own, min(ways, default=np.inf), *ways], dtype=float)
        self._reading = [(name, int(self.p_at[i + 1]) - SLOTS) for i, name in enumerate(body) if rest[name]]
        self.drive = _Filters(drive, drives, tuple(values[n] for n in drives))
        self.sensor = _Filters(sensor, sensors, tuple(values[n] for n in sensors))
        self._values = values
        self.body = body
        bends = [effects.get(name).kinks for name in body]
        found = [at(values[name]) for name, at in zip(body, bends, strict=True) if at]
        self.kinks = np.unique(np.array([x for each in found for x in each], dtype=float))

    @property
    def low_passes(self) -> tuple[tuple[float, float], ...] | None:
        """Of the sensor, each as s and s^2 of its denominator; None where one of its filters is no low-pass."""
        known = [effects.get(name).lag for name in self.sensor.names]
        if any(lag is None for lag in known):
            return None
        return tuple(lag(v) for lag, v in zip(known, self.sensor.values, strict=True) if lag is not None)

    def _way_rad(self, name: str, values: tuple[float, ...]) -> float:
        """Angle over which the states of an effect follow the motion; infinite where they follow something else."""
        way = effects.get(name).follows_within_rad
        return float(way((*self.jck.tolist(), *values))) if way else np.inf

    @property
    def states(self) -> int:
        """Number of internal states of all effects on the shaft."""
        return int(self.z_at[-1])

    @property
    def sticks(self) -> bool:
        """Whether dry friction can hold the platform."""
        return len(self.kernels) > self.loads

    def rest_states(self, angle_rad: float, rate_rad_s: float) -> Array:
        """Internal states of a platform that has stood at this angle and moves with this rate, shape (states,)."""
        z = np.zeros(self.states)
        if not self.states:
            return z
        for i, name in enumerate(self.body):
            rest = effects.get(name).rest_state
            if rest:
                z[self.z_at[i] : self.z_at[i + 1]] = rest(angle_rad, rate_rad_s)
        return z

    def rest_angle_rad(self, states: Array | None = None) -> float:
        """Where the platform stands without torque, near zero: what its loads pull there, the spring holds.

        Loads with a memory or a clock of their own are taken as they are at the start, or in these ``states``. Zero
        where no such place is found within a turn.
        """
        if not self.loads or not self.jck[2] > 0.0:
            return 0.0
        at = 0.0
        for _ in range(_NEWTON):
            here, beside = self.pull_nm(at, states), self.pull_nm(at + _BESIDE_RAD, states)
            slope = (beside - here) / _BESIDE_RAD
            if not slope > 0.0 or not abs(at) < 2.0 * np.pi:
                return 0.0
            at -= here / slope
        return at if abs(self.pull_nm(at, states)) <= 1e-9 * self.jck[2] else 0.0

    def pull_nm(self, angle_rad: float, states: Array | None = None) -> float:
        """Torque by which spring and loads pull a platform back that stands still at an angle."""
        states = self.rest_states(0.0, 0.0) if states is None else states
        return float(integrator.pull(angle_rad, states, self.jck, *self._loads_only()))

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

    def parameters_with(self, readings: Readings | None) -> tuple[Array, list[Array]]:
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
        self, torque: Array, step_s: float, start: tuple[float, float], readings: Readings | None = None,
        states: Array | None = None,
    ) -> Array:  # fmt: skip
        """Angle, rate and acceleration, shape (n + 1, 3), under a shaft torque of shape (n, 3).

        ``states`` are the internal states at the start, of a platform at rest where None; they are left as at the end.
        """
        p, _kept = self.parameters_with(readings)
        state = np.array([start[0], start[1], np.sign(start[1]), 0.0])
        out = np.empty((len(torque) + 1, 3))
        integrator.run_steps(
            state,
            self.rest_states(*start) if states is None else states,
            step_s,
            torque,
            self.jck,
            self.kernels,
            self.loads,
            self.z_at,
            p,
            self.p_at,
            self.kinks,
            self.steady,
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
        p, _kept = self.parameters_with(readings)
        out = np.zeros((len(torque) + 1, 3))
        if not spans:
            return out
        integrator.run_spans(
            starts, np.array(spans, dtype=np.int64), offset_s, self.rest_states(*starts[0]), step_s, torque,
            self.jck, self.kernels, self.loads, self.z_at, p, self.p_at, self.kinks, self.steady, out,
        )  # fmt: skip
        return out
