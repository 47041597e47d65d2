"""Whether the sets can separate damping from an undeclared delay or lag: far below the resonance they cannot.

A torque that comes late by a short time t lags by w t, and so does the motion of a damped spring whose C is K t.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.bounds.cramer_rao import information_of, together, with_delay
from identify.signals.torque_bandwidth import highest_torque_hz
from identify.signals.trace import Trace
from identify.wording import number
from rig.platform import Platform

SLOW_SET_RATIO = 0.5  # of the natural frequency: faster sets tell one from the other
LAGS = ("torque_delay", "actuator_lag", "sensor_lag")
EXAMPLE_LAG_S = 1e-3  # the example in the sentence
# Relative standard error of the inertia: what tells that so well tells damping from a delay as well.
WELL_KNOWN_INERTIA = 1e-4
MIN_RELATIVE_ERROR = 0.02  # relative standard error of C beside an unknown delay


def lag_for_damping(platform: Platform, inertia_std_error: float, traces: Sequence[Trace], axis: str) -> str:
    """What to say of C, in a sentence; empty where the runs tell damping from a delay, or a lag is in the model.

    Parameters
    ----------
    platform
        The final model.
    inertia_std_error
        One standard error of its inertia.
    traces
        The runs that fitted it.
    """
    inertia, stiffness = platform.inertia_kg_m2, platform.stiffness_nm_rad
    asked = "damping" in platform.terms and platform.damping_nm_s_rad > 0.0 and not set(LAGS) & set(platform.effects)
    if not asked or not (inertia > 0.0 and stiffness > 0.0) or any(t.torque is None for t in traces):
        return ""
    natural_hz = float(np.sqrt(stiffness / inertia)) / (2.0 * np.pi)
    if inertia_std_error < WELL_KNOWN_INERTIA * inertia or not all(
        highest_torque_hz(t) < SLOW_SET_RATIO * natural_hz for t in traces
    ):
        return ""
    with np.errstate(all="ignore"):
        late = together([information_of(t, with_delay(platform), len(traces)) for t in traces])
    if not late.relative(("damping",)) > MIN_RELATIVE_ERROR:
        return ""
    unit = "N s/m" if axis == "linear" else "N m s/rad"
    return (
        "These sets are too slow to separate damping from a delay or lag of the drive or the gyro: each undeclared "
        f"{1e3 * EXAMPLE_LAG_S:g} ms adds {number(stiffness * EXAMPLE_LAG_S, 2)} {unit} to the identified C of "
        f"{number(platform.damping_nm_s_rad, 3)} {unit}. Add a set near the resonance at {number(natural_hz, 2)} Hz, "
        "or one that starts abruptly."
    )
