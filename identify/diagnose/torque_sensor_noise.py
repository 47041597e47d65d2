"""Noise in the recorded torque: it excites the model but did not excite the platform."""

from __future__ import annotations

import numpy as np

from identify.results import Identification
from identify.signals.noise import noise_of
from identify.wording import number

MIN_TORQUE_NOISE_SHARE = 0.5  # of what is left, that it has to make
SENTENCE = (
    "The recorded {torque} contains noise of {noise} {unit} rms a sample; {passed} {unit} of it lies below {cutoff:g} "
    "Hz, where the residual is {left} {unit}. Record the commanded {torque} instead, or measure it with less noise: "
    "smaller effects are hidden by it."
)


def describe(found: Identification) -> str:
    """One sentence on it and what to do, where it makes most of the torque residual; else empty."""
    error = found.final.error
    left, cutoff = error.residual_rms_torque, error.lowpass_hz
    runs = [t for t in found.traces if t.torque_nm is not None]
    if left is None or not cutoff or not runs:
        return ""
    noise = [noise_of(np.asarray(t.torque_nm)) for t in runs]
    nyquists = [0.5 / float(np.median(np.diff(t.time_s))) for t in runs]
    passed = [n * np.sqrt(min(1.0, cutoff / f)) for n, f in zip(noise, nyquists, strict=True)]
    whole, below = (float(np.sqrt(np.mean(np.square(several)))) for several in (noise, passed))
    if not below > MIN_TORQUE_NOISE_SHARE * left:
        return ""
    linear = found.axis == "linear"
    return SENTENCE.format(
        torque="force" if linear else "torque", unit="N" if linear else "N m", noise=number(whole, 3),
        passed=number(below, 3), left=number(left, 3), cutoff=cutoff,
    )  # fmt: skip
