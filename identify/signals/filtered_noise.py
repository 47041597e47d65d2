"""How noisy samples behind a low-pass are where the noise of a channel is read off."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.linalg import expm

from rig.decimation import NOISE_BAND

NOISE_POINTS = 24  # of the band: the density is smooth


@lru_cache(maxsize=256)
def filtered_density(lag: tuple[float, float], step_s: float) -> float:
    """Mean density in the band of ``noise_of`` of noise of unit variance behind a low-pass, over that of white noise.

    The spectrum of the samples, with all that folds down: for states that keep ``phi`` over a sample and have the
    covariance ``p``, it is c (I - phi/z)^-1 (p - phi p phi') (I - phi/z)^-H c' (Astrom, Introduction to Stochastic
    Control Theory, 1970, ch. 4).

    Parameters
    ----------
    lag
        Coefficients of s and of s^2 in the denominator of the low-pass, s and s^2; the first is above zero.
    """
    first, second = lag
    if second > 0.0:
        phi = expm(np.array([[0.0, 1.0], [-1.0 / second, -first / second]]) * step_s)
        p = np.diag([1.0, 1.0 / second])
    else:
        phi, p = np.exp(np.array([[-step_s / first]])), np.eye(1)
    driven, one = p - phi @ p @ phi.T, np.eye(len(p))
    middles = NOISE_BAND[0] + (NOISE_BAND[1] - NOISE_BAND[0]) * (np.arange(NOISE_POINTS) + 0.5) / NOISE_POINTS
    rows = [np.linalg.inv(one - np.exp(-1j * np.pi * f) * phi)[0] for f in middles]
    return float(np.mean([np.real(row @ driven @ row.conj()) for row in rows]))
