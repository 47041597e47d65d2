"""Three effects of which one can follow anything: believed only where nothing but white noise is left.

Unequal end stops once came to 1.025 of the noise's variance as gravity, a gap and cogging together, a spring that
relaxes twice as creep, cogging and presliding. What a wrong set of shapes leaves lies where the platform moves; noise
is as large above. Set side by side in one spectrum, that shows far sooner than in the sum, and needs no reading of the
noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.estimate.final_fit import FinalFit
from identify.model.parameter_fit import reduced_chi_square
from identify.signals.trace import Trace, pooled_noise
from rig import effects
from rig.effects.base import Place

MIN_EFFECTS_TESTED = 3  # effects beside those declared
BANDS = (0.05, 0.1, 0.2, 0.4)  # of Nyquist: where a platform may move
MOTIONLESS_BAND = (0.5, 0.98)  # of Nyquist: where it does not
UNEXPLAINED_CHI_SQUARE = 1.1**2  # reduced chi-square in free run: above it, something is left that no effect explains
COLOURED_SIGMAS = 5.0  # standard errors by which a band may stand out


def fails_whiteness_test(fitted: FinalFit, declared: Sequence[str]) -> bool:
    """Whether what was found beside the declared effects is more than a residual like this one supports."""
    found = [e for e in fitted.structure.effects if e not in declared]
    if len(found) < MIN_EFFECTS_TESTED or not any(effects.get(e).is_flexible for e in found):
        return False
    return leaves_more_than_noise(fitted)


def leaves_more_than_noise(fitted: FinalFit) -> bool:
    """Whether a free run over whole runs leaves more than white noise of the sensor."""
    return not fitted.sensor_limited or coloured(fitted) > COLOURED_SIGMAS


def leaves_a_disturbance(fitted: FinalFit, traces: Sequence[Trace]) -> bool:
    """Whether a free run leaves more than the sensor's noise, though every next sample is predicted down to that.

    A small torque that nobody recorded adds up over a run. It is a disturbance, of which is told what it depends on.
    Where dry friction acts one wrong standstill throws a free run off for good, and the fit's own horizon is asked.
    """
    error = fitted.fit.held_out_error
    sticks = any(effects.get(e).place is Place.FRICTION for e in fitted.structure.effects)
    if fitted.free_run is not None and not fitted.sensor_limited and not sticks and np.isfinite(fitted.free_run.sigma):
        error = max(error, fitted.free_run.sigma)
    return reduced_chi_square(error, pooled_noise(traces)) > UNEXPLAINED_CHI_SQUARE


def coloured(fitted: FinalFit) -> float:
    """By how many standard errors the power of the free run's residual stands out low in the spectrum."""
    if fitted.free_run is None:
        return float("inf")
    low, count, high, beside = np.zeros(len(BANDS)), np.zeros(len(BANDS)), 0.0, 0
    for shots, residual in zip(fitted.free_run.shots, fitted.free_run.residuals(), strict=True):
        if not np.any(shots.weight):
            continue
        left = np.where(shots.weight, residual - np.mean(residual[shots.weight]), 0.0)
        power = np.abs(np.fft.rfft(left)) ** 2
        f = np.arange(len(power)) / len(power)
        for i, top in enumerate(BANDS):
            inside = (f > 0.0) & (f < top)
            low[i] += float(np.sum(power[inside]))
            count[i] += int(np.sum(inside))
        outside = (f > MOTIONLESS_BAND[0]) & (f < MOTIONLESS_BAND[1])
        high, beside = high + float(np.sum(power[outside])), beside + int(np.sum(outside))
    ratio = (low / np.maximum(count, 1)) / (high / max(beside, 1))
    return float(np.max((ratio - 1.0) / np.sqrt(1.0 / np.maximum(count, 1) + 1.0 / max(beside, 1))))
