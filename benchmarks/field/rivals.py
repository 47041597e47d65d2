"""Who else could take the place of an effect: every library effect along the true motion, over a grid of its shapes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.field.library import LIBRARY, Scale
from benchmarks.field.oracle import torque_along
from benchmarks.field.plant import PARAMETERS
from benchmarks.field.recording import Motion
from benchmarks.field.rigs import Rig

SIZED = ("backlash", "torque_delay", "actuator_lag", "sensor_lag", "torque_deadzone", "torque_saturation")
# Effects that contain another one: they explain whatever it explains, and are no rivals of it.
CONTAIN = {
    "coulomb_friction": ("stribeck_friction", "presliding_friction", "hysteresis"),
    "presliding_friction": ("hysteresis",),
}
NOT_TRIED = ("periodic_disturbance",)  # a line in time passes for nothing else, and a grid of lines is endless
WAVES = (2.5, 4.0, 6.3)  # angle in rad of a slow cogging from rest to the peak; with less it is a polynomial


def shapes(s: Scale) -> Mapping[str, Mapping[str, Sequence[float]]]:
    """Values of the numbers that do not enter linearly, by effect, SI units."""
    middle = 1.0 / (2.0 * np.pi * s.middle_hz)
    late = 1.0 / (2.0 * np.pi * s.torque_hz)
    return {
        "stribeck_friction": {"speed": [f * s.rate for f in (0.05, 0.15, 0.4, 1.0)]},
        "presliding_friction": {"displacement": [f * s.angle_peak for f in (0.01, 0.03, 0.1, 0.3)]},
        "hysteresis": {
            "yield_angle": [f * s.angle_peak for f in (0.1, 0.3, 0.7)], "exponent": [1.5], "share": [0.3, 0.8]
        },
        "creep": {"time": [f * middle for f in (0.3, 1.0, 3.0, 10.0)]},
        "flexible_mode": {
            "frequency": list(np.geomspace(0.5 * s.rig.high_hz, 0.2 * s.rig.sample_hz, 6)), "ratio": [0.05]
        },
        "backlash": {"half_gap": [f * s.angle_peak for f in (0.02, 0.08, 0.25)]},
        "cogging": {"order": [f / s.angle_peak for f in WAVES]},
        "torque_delay": {"delay": [f * late for f in (0.01, 0.05, 0.2)]},
        "actuator_lag": {"time": [f * late for f in (0.01, 0.05, 0.2)]},
        "sensor_lag": {"time": [f * late for f in (0.01, 0.05, 0.2)]},
        "torque_deadzone": {"width": [f * s.torque for f in (0.03, 0.1, 0.3)]},
        "torque_saturation": {"limit": [f * s.torque_peak for f in (0.5, 0.7, 0.9)]},
    }  # fmt: skip


def tried_on(rig: Rig, name: str, truth: Sequence[str]) -> list[str]:
    """Library effects that could be named on a rig in the place of ``name``."""
    left_out = {*truth, *NOT_TRIED, *CONTAIN.get(name, ())}
    out = []
    for rival, kind in LIBRARY.items():
        fits = kind.spring in (None, rig.has_spring)
        fits &= rig.torque_column == "command" or kind.wants.get("torque_column") is None
        if rival == "sensor_lag":
            fits &= rig.sensors == "gyro"
        if rival == "torque_offset":
            fits &= not (rig.has_spring and rig.sensors == "gyro")
        if rival == "cogging":
            fits &= name != "unbalance"  # which is one of order 1
        if fits and rival not in left_out:
            out.append(rival)
    return out


def columns(rig: Rig, motions: Sequence[Motion], name: str, s: Scale) -> list[list[list[Any]]]:
    """For every shape of an effect, its torque along each run in fine steps, one series a gain."""
    grid = shapes(s).get(name, {})
    fixed = [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]
    gains = [k for k in PARAMETERS[name] if k not in grid]
    out = []
    for shape in fixed:
        runs = []
        for m in motions:
            if name in SIZED:
                parts = [torque_along(rig, m, name, shape)]
            else:
                parts = [torque_along(rig, m, name, {**dict.fromkeys(gains, 0.0), **shape, g: 1.0}) for g in gains]
            runs.append(parts)
        out.append(runs)
    return out
