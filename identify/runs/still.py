"""Runs in which the platform stood still while others moved it: they tell nothing of it, and make a model look wrong.

Dry friction holds a platform against a torque below its own. A model that does not know the friction yet would move
there, and that one run then outweighs all others.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import signal

from identify.signals.noise import NOISE_SCATTER
from identify.signals.trace import UPSAMPLING, Trace
from identify.wording import joined, number

MOTION_SIGMAS = 5.0  # standard errors of the noise: what is louder has moved
RESPONSE_SIGMAS = 4.0  # standard errors: what goes along with the torque by that much has moved, hidden in the noise


def still_runs(traces: Sequence[Trace]) -> list[Trace]:
    """The runs in which a torque moved nothing; none where that is so in all of them."""
    still = [t for t in traces if _stood(t)]
    return still if len(still) < len(traces) else []


def describe_still_runs(runs: Sequence[Trace], axis: str) -> str:
    """What was left out, in words; empty where nothing was."""
    if not runs:
        return ""
    what, unit = ("force", "N") if axis == "linear" else ("torque", "N m")
    each = [f"{t.run.name} ({number(_largest(t), 3)} {unit})" for t in runs]
    return (
        f"Excluded because the platform did not move: {joined(each)}; friction held it at that {what}, or the drive "
        "was off"
    )


def _largest(trace: Trace) -> float:
    return 0.0 if trace.torque is None else float(np.max(np.abs(trace.torque.torque_nm)))


def _stood(trace: Trace) -> bool:
    if trace.torque is None or not float(np.ptp(trace.torque.torque_nm)) > 0.0:
        return False
    kept = trace.measured[trace.keep] - np.mean(trace.measured[trace.keep])
    if np.std(kept) > trace.noise * (1.0 + MOTION_SIGMAS * NOISE_SCATTER / float(np.sqrt(len(kept)))):
        return False
    torque = trace.fine[3][::UPSAMPLING]
    both = signal.hilbert(torque - np.mean(torque))[trace.keep]  # in phase and a quarter of a period late
    for part in (both.real, both.imag):
        shape = part - np.mean(part)
        size = float(np.linalg.norm(shape))
        if size > 0.0 and abs(float(shape @ kept)) > RESPONSE_SIGMAS * trace.noise * size:
            return False
    return True
