"""One set of plausible parameter values for every effect, on the paper's platform."""

from __future__ import annotations

from collections.abc import Mapping

VALUES: Mapping[str, Mapping[str, float]] = {
    "coulomb_friction": {"level": 1.2},
    "stribeck_friction": {"coulomb": 1.2, "static": 2.4, "speed": 0.08},
    "presliding_friction": {"level": 1.0, "displacement": 0.004},
    "load_dependent_friction": {"factor": 0.02},
    "quadratic_damping": {"factor": 0.05},
    "directional_damping": {"step": 0.03},
    "cubic_stiffness": {"factor": 3000.0},
    "quadratic_stiffness": {"factor": 300.0},
    "bilinear_stiffness": {"step": 15.0},
    "backlash": {"half_gap": 0.0033},
    "hysteresis": {"level": 1.0, "yield_angle": 0.05, "exponent": 1.5, "share": 0.4},
    "creep": {"stiffness": 10.0, "time": 0.2},
    "stiffness_drift": {"slope": 2.0},
    "unbalance": {"sine": 3.0, "cosine": 5.0},
    "cogging": {"sine": 0.6, "cosine": 0.5, "order": 37.0},
    "torque_delay": {"delay": 0.0015},
    "actuator_lag": {"time": 0.003},
    "torque_saturation": {"limit": 70.0},
    "torque_deadzone": {"width": 1.0},
    "torque_scale": {"scale": 1.07},
    "torque_offset": {"level": 1.0},
    "flexible_mode": {"inertia": 0.0005, "frequency": 70.0, "ratio": 0.02},
    "sensor_lag": {"time": 0.002},
    "rate_bias": {"bias": 0.001},
    "periodic_disturbance": {"sine": 0.5, "cosine": 0.3, "frequency": 13.37},
}
