"""Pre-flight: what every set would do to the declared platform, before anything moves."""

from rig.preflight.declared_model import model_hint
from rig.preflight.prediction import (
    Prediction,
    allowed_peaks,
    limits_broken,
    peaks,
    plan,
    playable_sets,
    predict,
    predict_all,
)
from rig.preflight.simulated_sets import Peaks, peak_torque_nm

__all__ = [
    "Peaks",
    "Prediction",
    "allowed_peaks",
    "limits_broken",
    "model_hint",
    "peak_torque_nm",
    "peaks",
    "plan",
    "playable_sets",
    "predict",
    "predict_all",
]
