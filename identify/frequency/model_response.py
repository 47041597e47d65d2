"""The frequency response of a model: J, C, K and those of its effects that are linear.

Which effects are linear is asked of their own compiled equations: what doubles when the motion doubles, and does not
look at the clock, is. The others (dry friction, a gap, an unbalance) have no response of their own: theirs
depends on the amplitude, and they are named instead.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identify.frequency.spectra import Complex
from rig import effects
from rig.dynamics.filters import run_filter
from rig.dynamics.native import addresses
from rig.effects.base import Effect, Place
from rig.platform import Platform
from rig.recording.run import Array

LINEARITY_TOLERANCE = 1e-6  # relative: what a sum of motions may differ from the sum of the torques
PROBE_S = 4.0  # length of an impulse response: eight of the longest time constants that a lag is searched up to
FINENESS = 40.0  # samples of it in a period of the highest frequency


@dataclass(frozen=True)
class Size:
    """How large the motion is (root mean square): what is linear has to be so at this size."""

    angle_rad: float
    rate_rad_s: float
    torque_nm: float


def linear_response(platform: Platform, frequency_hz: Array, size: Size) -> tuple[Complex, tuple[str, ...]]:
    """Rate over torque, (rad/s)/(N m), shape (m,), and the names of the effects that stand in no linear response.

    rate / torque = drive * sensor * s / (J s^2 + C s + K + effects), s = 2 pi i frequency.
    """
    s = 2j * np.pi * np.asarray(frequency_hz, dtype=float)
    stiff = platform.inertia_kg_m2 * s * s + platform.damping_nm_s_rad * s + platform.stiffness_nm_rad
    through: Complex = np.ones(len(s), dtype=complex)
    left_out = []
    jck = (platform.inertia_kg_m2, platform.damping_nm_s_rad, platform.stiffness_nm_rad)
    for name, given in platform.effects.items():
        effect = effects.get(name)
        values = effect.values(given)
        if effect.place in (Place.DRIVE, Place.SENSOR):
            level = size.torque_nm if effect.place is Place.DRIVE else size.rate_rad_s
            one = _filter_response(effect, values, np.asarray(frequency_hz, dtype=float), level)
            through = through if one is None else through * one
        else:
            alone = effect.place is Place.LOAD and not effect.reads  # what follows a channel has no response of its own
            one = _load_response(effect, (*jck, *values), s, size) if alone else None
            stiff = stiff if one is None else stiff + one
        if one is None:
            left_out.append(name)
    return through * s / stiff, tuple(left_out)


def _joined(phase_rad: Array) -> Complex:
    """What joining samples by a parabola through the last three makes of a sine that turns by a phase a sample."""
    nodes, shares = np.polynomial.legendre.leggauss(6)
    u, shares = 0.5 * (nodes - 1.0), 0.5 * shares  # of the step that ends at a sample, from -1 to 0
    ends, lies_before, lies_two_before = 1.0 + 1.5 * u + 0.5 * u * u, -2.0 * u - u * u, 0.5 * (u + u * u)
    turn = np.exp(-1j * np.outer(phase_rad, u))
    parts = [turn @ (shares * part) for part in (ends, lies_before, lies_two_before)]
    return np.asarray(sum(part * np.exp(-1j * k * phase_rad) for k, part in enumerate(parts)))


def _filter_response(effect: Effect, values: tuple[float, ...], frequency_hz: Array, level: float) -> Complex | None:
    """Response of a drive or sensor filter from its answer to a short pulse; None where that is not in proportion."""
    step = 1.0 / (FINENESS * float(np.max(frequency_hz)))
    n = min(round(PROBE_S / step), 60_000)
    pulse = np.zeros(n)
    pulse[1] = level or 1.0
    states = effect.filter_states(step, values) if effect.filter_states else 0
    p = np.array(values, dtype=float)

    def answer(x: Array) -> Array:
        out = x.copy()
        run_filter(
            addresses([effect.kernel]), out, step, np.zeros(states), np.array([0, states]), p, np.array([0, len(p)])
        )
        return out

    rest = answer(np.zeros(n))
    whole, tenth = answer(pulse) - rest, answer(-0.1 * pulse) - rest
    if not np.allclose(tenth, -0.1 * whole, rtol=0.0, atol=LINEARITY_TOLERANCE * float(np.max(np.abs(pulse)))):
        return None
    used = np.flatnonzero(np.abs(whole) > 1e-9 * np.max(np.abs(whole)))
    turn = np.exp(-2j * np.pi * np.outer(frequency_hz, step * (used - 1.0)))
    joined = _joined(2.0 * np.pi * frequency_hz * step) if states and len(used) > 8 else 1.0
    return np.asarray(turn @ whole[used] / pulse[1] / joined)


def _load_response(effect: Effect, p: tuple[float, ...], s: Complex, size: Size) -> Complex | None:
    """Torque of an effect over angle, shape (m,), from its equation taken apart; None where it is not linear.

    With x = (angle, rate, states): torque = c x, d(states)/dt = A x, each column from the equation itself.
    """
    scale = np.array([size.angle_rad or 1.0, size.rate_rad_s or 1.0, *_state_sizes(effect, size)])

    def rows(x: Array, time_s: float = 0.0, torque_nm: float = 0.0) -> Array:
        return np.array(_called(effect, x, time_s, torque_nm, p))

    rest = rows(np.zeros(len(scale)))
    unit = np.stack([(rows(scale * e) - rest) / scale[i] for i, e in enumerate(np.eye(len(scale)))], axis=1)
    rng = np.random.default_rng(1)
    for _ in range(4):
        x = scale * rng.uniform(-1.0, 1.0, len(scale))
        there = rows(x, 3.7, size.torque_nm) - rest
        reach = np.abs(unit) @ scale + 1e-12
        if np.any(np.abs(there - unit @ x) > LINEARITY_TOLERANCE * reach):
            return None
    motion = np.stack([np.ones(len(s)), s])  # angle and rate over angle
    states = effect.states
    inner = s[:, None, None] * np.eye(states) - unit[1:, 2:]
    z = np.linalg.solve(inner, (unit[1:, :2] @ motion).T[:, :, None])[:, :, 0] if states else np.zeros((len(s), 0))
    return np.asarray(unit[0, :2] @ motion + z @ unit[0, 2:])


def _state_sizes(effect: Effect, size: Size) -> Sequence[float]:
    if effect.rest_state is None:
        return [size.angle_rad or 1.0] * effect.states
    return [abs(v) or 1.0 for v in effect.rest_state(size.angle_rad or 1.0, size.rate_rad_s or 1.0)]


def _called(effect: Effect, x: Array, time_s: float, torque_nm: float, p: tuple[float, ...]) -> list[float]:
    """Torque and state derivatives of a LOAD kernel."""
    room = max(1, effect.states)
    z, dz = (ctypes.c_double * room)(*x[2:]), (ctypes.c_double * room)()
    torque = effect.kernel.ctypes(x[0], x[1], time_s, torque_nm, z, dz, (ctypes.c_double * len(p))(*p))
    return [float(torque), *list(dz)[: effect.states]]
