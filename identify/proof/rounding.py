"""Commands in the steps of a drive, with what a step loses made good by the next ones where the platform feels it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_toeplitz

from rig import effects
from rig.arrays import Array
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform

# Values of a feedback: two for each resonance, with the effect and without. Of two to eight, from four on nothing more
# is gained (flexible mode of 0.014 to 0.026 kg m2 on 0.0203 kg m2, 58 to 68 Hz).
FEEDBACK_TICKS = 4
DIAGONAL_LIFT = 1e-9  # relative; a resonance that hardly decays makes the equations nearly singular


def feedback(platform: Platform, tick_s: float, duration_s: float) -> Array:
    """What of the rounding of the last commands each command makes good, the last one first, (n,).

    A rounding is in the recorded torque, which the linear model is given too: an error is only what the platform makes
    of it beyond J, C, K. Where effects with linear dynamics of their own change the response to a torque, the feedback
    is the one that leaves least of the rounding in that change (linear prediction on its autocorrelation; Makhoul,
    Proc. IEEE 63, 1975). Without any, none is left at the natural frequency and little below it (zero of the error
    feedback there; Schreier, Temes, Understanding Delta-Sigma Converters).
    """
    own = {n: v for n, v in platform.effects.items() if effects.get(n).has_linear_states}
    if own:
        time_s = tick_s * np.arange(math.ceil(duration_s / tick_s))
        once = TorqueSignal(time_s, np.where(time_s > 0.0, 0.0, 1.0), "zero_order")
        with np.errstate(all="ignore"):
            moved = [simulate(replace(platform, effects=of), time_s, once).rate_rad_s for of in (own, {})]
        change = moved[0] - moved[1]
        lags = [float(change[k:] @ change[: len(change) - k]) for k in range(FEEDBACK_TICKS + 1)]
        if np.all(np.isfinite(lags)) and lags[0] > 0.0:
            row = np.array(lags[:-1])
            row[0] *= 1.0 + DIAGONAL_LIFT
            found: Array = solve_toeplitz(row, np.array(lags[1:]))
            return found
    natural_rad_s = math.sqrt(max(platform.stiffness_nm_rad, 0.0) / platform.inertia_kg_m2)
    return np.array([2.0 * math.cos(min(natural_rad_s * tick_s, math.pi)), -1.0])


def rounded(torque_nm: Array, resolution_nm: float, made_good: Array) -> Array:
    """Commands in steps of a drive, (n,).

    Parameters
    ----------
    torque_nm
        Shape (n,): what is wanted at each tick.
    made_good
        Of the rounding of the commands before each, the last one first (see ``feedback``).
    """
    out, lost = np.empty(len(torque_nm)), [0.0] * len(made_good)
    shares = made_good.tolist()
    for i, wanted in enumerate(torque_nm.tolist()):
        asked = wanted - sum(share * rest for share, rest in zip(shares, lost, strict=True))
        out[i] = resolution_nm * round(asked / resolution_nm)
        lost = [out[i] - asked, *lost[:-1]]
    return out
