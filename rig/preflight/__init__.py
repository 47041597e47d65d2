"""Pre-flight: what every set would do to the declared platform, before anything moves."""

from rig.preflight.prediction import (
    Prediction,
    allowed_peaks,
    model_hint,
    peaks,
    plan,
    playable_sets,
    predict,
    predict_all,
)
from rig.preflight.simulated_sets import Peaks

__all__ = [
    "Peaks",
    "Prediction",
    "allowed_peaks",
    "model_hint",
    "peaks",
    "plan",
    "playable_sets",
    "predict",
    "predict_all",
]
